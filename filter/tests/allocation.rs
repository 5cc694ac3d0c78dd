//! Steady state allocates nothing. Alone in its file: the allocator is the process's.

use nalgebra::Vector3;
use randt_counting_allocator::{CountingAllocator, allocations};
use randt_filter::{AttitudeFilter, ClusterFilter, Standstill};
use randt_messages::{Message, RadarPoints, RadarScan, Return};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A sweep with `per_beam` returns in each of 220 beams.
fn sweep(per_beam: u16) -> Message<RadarScan> {
    let mut scan = Message::<RadarScan>::default();
    scan.head.sweep.beam_count = 220;
    for beam in 0..220 {
        scan.head.sweep.beams[usize::from(beam)].first_return = scan.items.len() as u32;
        scan.items.extend((0..per_beam).map(|bin| Return {
            range_m: 1.0 + 0.0161 * f32::from(bin),
            intensity: 10.0 + f32::from((bin * 7 + beam) % 13),
            beam,
            bin,
        }));
    }
    scan
}

#[test]
fn nothing_is_allocated_in_steady_state() {
    let sweeps: Vec<_> = (1..200).map(sweep).collect();
    let mut filter = ClusterFilter::new(&Default::default(), &Default::default());
    let mut points = Message::<RadarPoints>::default();
    filter.process(sweeps[0].as_ref(), &mut points);

    let mut attitude = AttitudeFilter::new(&Default::default());
    let mut standstill = Standstill::new(&Default::default());
    let mut measurements = 0;

    let before = allocations();
    for scan in &sweeps {
        filter.process(scan.as_ref(), &mut points);
    }
    for stamp_ns in (0..5_000_000_000).step_by(4_000_000) {
        let (rate, up) = (Vector3::zeros(), Vector3::z() * 9.81);
        measurements += u32::from(standstill.push(stamp_ns, rate, up).is_some());
        attitude.push(stamp_ns, rate, up);
    }
    let after = allocations();
    assert_eq!(after - before, 0, "allocations in {} sweeps", sweeps.len());
    assert!(!points.items.is_empty() && measurements > 0);
}
