use super::*;
use crate::{BeamLayout, Echo};
use proptest::prelude::*;
use randt_messages::{Message, RadarScan, SensorKind};

const BEAMS: u16 = 220;
const TURN_NS: i64 = 200_000_000;
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// Beam `index` of a radar that turns without end; its device clock began at 5 s.
fn beam(index: i64) -> RawBeam {
    let step_ns = TURN_NS / i64::from(BEAMS);
    let at = index.rem_euclid(i64::from(BEAMS));
    RawBeam {
        position: BeamPosition::Numbered {
            sweep: index.div_euclid(i64::from(BEAMS)) as u32,
            beam: at as u16,
        },
        azimuth: (at * (TURN / i64::from(BEAMS))) as u32,
        device_ns: Some(5_000_000_000 + index * step_ns),
        arrival_ns: EPOCH_NS + index * step_ns + 300_000,
        layout: BeamLayout {
            beams: BEAMS,
            clockwise: false,
            bin_m: 0.0161,
            first_m: 0.0,
            turn_ns: None,
        },
        echoes: vec![Echo {
            bin: at as u16,
            intensity: 10.0,
        }],
        dropped: 1,
        ..RawBeam::default()
    }
}

/// The same of a radar with a running counter that counts clockwise. It has turned a little
/// before, since its sense must be known.
fn running(index: i64) -> RawBeam {
    let mut beam = beam(index);
    beam.position = BeamPosition::Running(index as u16);
    beam.layout.clockwise = true;
    beam
}

fn sweeps(
    assembler: &mut Assembler,
    beams: impl IntoIterator<Item = RawBeam>,
) -> Vec<Message<RadarScan>> {
    let mut out = Vec::new();
    let mut beams = beams.into_iter().peekable();
    if let Some(first) = beams
        .peek()
        .filter(|beam| beam.position == BeamPosition::Running(0))
    {
        let step = (TURN / i64::from(BEAMS)) as u32;
        for before in (1..10_u16).rev() {
            let mut beam = first.clone();
            beam.position = BeamPosition::Running(before.wrapping_neg());
            beam.azimuth = (u32::from(before) * step).wrapping_neg();
            assembler.push(&beam, &mut |_| {});
        }
    }
    for beam in beams {
        assembler.push(&beam, &mut |sweep| {
            out.push(sweep.message(SensorKind::IsdrC))
        });
    }
    out
}

/// A radar that stands still for two seconds in the middle of a sweep, and goes on where it was.
#[test]
fn what_was_seen_before_a_pause_is_another_sweep() {
    for kind in [beam, running] {
        let mut assembler = Assembler::new(TURN_NS);
        let paused = |index: i64| {
            let mut beam = kind(index);
            let pause_ns = if index < 220 * 3 + 150 {
                0
            } else {
                2_000_000_000
            };
            beam.device_ns = beam.device_ns.map(|device_ns| device_ns + pause_ns);
            beam.arrival_ns += pause_ns;
            beam
        };
        let out = sweeps(&mut assembler, (0..220 * 7).map(paused));
        assert_eq!(count(&assembler, "pauses"), 1);
        let lost: Vec<u32> = out.iter().map(|scan| scan.head.sweep.beams_lost).collect();
        assert_eq!(lost, [0, 0, 0, 70, 0, 0, 0]);
        for scan in &out {
            let head = &scan.head.sweep;
            let took_ns = head.end_ns - head.begin_ns;
            assert!(took_ns <= TURN_NS + 1_000_000, "{took_ns}");
        }
        // Nor does it disturb the times of what follows.
        let end_ns = EPOCH_NS + 300_000 + 7 * TURN_NS + 2_000_000_000;
        let off_ns = out[6].head.sweep.end_ns - end_ns;
        assert!(off_ns.abs() < 1_000_000, "{off_ns}");
    }
}

fn count(assembler: &Assembler, name: &str) -> u64 {
    let mut found = None;
    assembler.counts(&mut |count| {
        if count.name == name {
            found = Some(count.value);
        }
    });
    found.unwrap()
}

#[test]
fn a_sweep_is_whole_with_its_last_beam() {
    for kind in [beam, running] {
        let mut assembler = Assembler::new(TURN_NS);
        let out = sweeps(&mut assembler, (0..220 * 3).map(kind));
        assert_eq!(out.len(), 3, "the third one without a beam of the fourth");
        for (number, scan) in out.iter().enumerate() {
            let head = &scan.head.sweep;
            assert_eq!((head.beam_count, head.beams_lost), (220, 0));
            assert_eq!(head.returns_dropped, 220);
            let begin_ns = EPOCH_NS + 300_000 + number as i64 * TURN_NS;
            let half_ns = TURN_NS / 440;
            assert!((head.begin_ns - (begin_ns - half_ns)).abs() < 2000);
            assert!((head.end_ns - (begin_ns + TURN_NS - half_ns)).abs() < 2000);
            assert_eq!(scan.head.header.stamp_ns, head.end_ns);
            for (index, beam) in head.beams().iter().enumerate() {
                let item = scan.items[beam.first_return as usize];
                assert_eq!(
                    (usize::from(item.beam), usize::from(item.bin)),
                    (index, index)
                );
                let at_ns = begin_ns + index as i64 * (TURN_NS / 220);
                assert!((beam.stamp_ns - at_ns).abs() < 2000);
            }
        }
        assert_eq!(count(&assembler, "beams_lost"), 0);
    }
}

#[test]
fn clockwise_radars_are_turned_at_the_door() {
    let mut assembler = Assembler::new(TURN_NS);
    let out = sweeps(&mut assembler, (0..220).map(running));
    let beams = out[0].head.sweep.beams();
    let step = 2.0 * std::f32::consts::PI / 220.0;
    assert!((beams[1].azimuth_rad + step).abs() < 1e-6);
    assert!((beams[219].azimuth_rad - step).abs() < 1e-5);
    assert!(
        beams
            .iter()
            .all(|beam| (-std::f32::consts::PI..std::f32::consts::PI).contains(&beam.azimuth_rad))
    );
}

#[test]
fn the_first_sweep_begins_at_a_wrap() {
    for kind in [beam, running] {
        let mut assembler = Assembler::new(TURN_NS);
        let out = sweeps(&mut assembler, (100..220 * 3).map(kind));
        assert_eq!(out.len(), 2);
        assert_eq!(out[0].head.sweep.beams_lost, 0);
        assert_eq!(count(&assembler, "beams_before_the_first_sweep"), 120);
    }
}

#[test]
fn azimuths_may_fall() {
    let mut assembler = Assembler::new(TURN_NS);
    let out = sweeps(
        &mut assembler,
        (1..220 * 4).map(|index| {
            let mut beam = running(index);
            beam.azimuth = beam.azimuth.wrapping_neg();
            beam
        }),
    );
    assert_eq!(out.len(), 3);
    assert_eq!(
        count(&assembler, "beams_lost") + count(&assembler, "beams_late"),
        0
    );
    let beams = out[0].head.sweep.beams();
    let step = 2.0 * std::f32::consts::PI / 220.0;
    assert!((beams[1].azimuth_rad - beams[0].azimuth_rad - step).abs() < 1e-5);
    assert!((beams[219].stamp_ns - beams[0].stamp_ns - TURN_NS * 219 / 220).abs() < 2000);
}

#[test]
fn lost_beams_are_counted_wherever_they_are() {
    for kind in [beam, running] {
        for lost in [vec![0], vec![219], vec![7, 8, 9], (100..190).collect()] {
            let mut assembler = Assembler::new(TURN_NS);
            let gone = |index: &i64| lost.contains(&(index - 220));
            let out = sweeps(
                &mut assembler,
                (0..220 * 4).filter(|index| !gone(index)).map(kind),
            );
            assert_eq!(out.len(), 4, "{lost:?}");
            let flags: Vec<usize> = out
                .iter()
                .map(|scan| scan.head.sweep.beams_lost as usize)
                .collect();
            assert_eq!(flags[1], lost.len(), "{lost:?}: {flags:?}");
            assert_eq!(flags.iter().sum::<usize>(), lost.len());
            assert_eq!(count(&assembler, "beams_lost"), lost.len() as u64);
            assert_eq!(count(&assembler, "sweeps_partial"), 1);
        }
    }
}

#[test]
fn beams_that_are_reordered_are_put_in_order() {
    let mut order: Vec<i64> = (0..220 * 3).collect();
    for at in [5, 100, 219, 300, 438] {
        order.swap(at, at + 1);
    }
    let mut assembler = Assembler::new(TURN_NS);
    let mixed = sweeps(&mut assembler, order.into_iter().map(beam));
    let plain = sweeps(&mut Assembler::new(TURN_NS), (0..220 * 3).map(beam));
    assert_eq!(mixed.len(), 3);
    for (mixed, plain) in mixed.iter().zip(&plain) {
        assert!(mixed.items == plain.items);
        assert_eq!(mixed.head.sweep.beams_lost, 0);
    }
}

#[test]
fn doubled_and_late_beams_are_distinguished() {
    let mut assembler = Assembler::new(TURN_NS);
    let order = (0..220 * 2)
        .filter(|index| *index != 50)
        .chain([439, 430, 50]);
    let out = sweeps(&mut assembler, order.map(beam));
    assert_eq!(out.len(), 2);
    assert_eq!(count(&assembler, "beams_doubled"), 2);
    assert_eq!(count(&assembler, "beams_late"), 1);
    assert_eq!(count(&assembler, "beams_lost"), 1);
}

#[test]
fn sweeps_that_are_missing_altogether_are_lost_beams() {
    let mut assembler = Assembler::new(TURN_NS);
    let out = sweeps(&mut assembler, (0..220).chain(1320..1540).map(beam));
    assert_eq!(out.len(), 2);
    assert_eq!(count(&assembler, "beams_lost"), 1100);
    assert_eq!(out[1].head.sweep.beams_lost, 220);
}

#[test]
fn a_running_counter_that_begins_anew_is_followed() {
    let mut assembler = Assembler::new(TURN_NS);
    let again = (0..440).map(|index| {
        let mut beam = running(index);
        beam.arrival_ns += 2_000_000_000;
        beam
    });
    let out = sweeps(&mut assembler, (0..2200).map(running).chain(again));
    assert_eq!(out.len(), 12);
    assert_eq!(count(&assembler, "sequence_anew"), 1);
    assert_eq!(count(&assembler, "clock_restarts"), 1);
}

#[test]
fn numbers_of_sweeps_go_on_at_zero() {
    let mut assembler = Assembler::new(TURN_NS);
    let beams = (0..220 * 4).map(|index| {
        let mut beam = beam(index);
        if let BeamPosition::Numbered { sweep, .. } = &mut beam.position {
            *sweep = sweep.wrapping_sub(2);
        }
        beam
    });
    assert_eq!(sweeps(&mut assembler, beams).len(), 4);
    assert_eq!(count(&assembler, "beams_lost"), 0);
}

#[test]
fn bursts_of_stamps_do_not_move_a_beam() {
    let mut assembler = Assembler::new(TURN_NS);
    let out = sweeps(
        &mut assembler,
        (0..220 * 20).map(|index| {
            let mut beam = running(index);
            // Stamps of twelve beams at once, up to 10 ms late.
            beam.device_ns = running(index / 12 * 12 + 11).device_ns;
            beam.arrival_ns = running(index / 12 * 12 + 11).arrival_ns;
            beam
        }),
    );
    let last = &out[19].head.sweep;
    let span_ns = last.end_ns - last.begin_ns;
    assert!((span_ns - TURN_NS).abs() < 300_000, "{span_ns}");
}

#[test]
fn without_sensible_stamps_arrivals_count() {
    let mut assembler = Assembler::new(TURN_NS);
    let out = sweeps(
        &mut assembler,
        (0..220 * 2).map(|index| {
            let mut beam = running(index);
            beam.device_ns = (index >= 220).then_some(index * 77_000_000_000);
            beam
        }),
    );
    assert_eq!(count(&assembler, "sweeps_timed_by_arrival"), 2);
    let head = &out[1].head.sweep;
    assert!((head.beams[0].stamp_ns - running(220).arrival_ns).abs() < 2000);
}

proptest! {
    /// Whatever is lost, doubled or swapped: every beam of the wire is in a sweep or in a counter.
    #[test]
    fn every_beam_is_somewhere(
        faults in prop::collection::vec((0..1500_i64, 0..3_u8), 0..60),
        numbered in any::<bool>(),
        jitter in 0..4_000_000_i64,
    ) {
        let mut order: Vec<i64> = (0..1500).collect();
        for (at, fault) in faults {
            let at = at as usize % order.len();
            match fault {
                0 => { order.remove(at); }
                1 if numbered => order.insert(at, order[at]),
                _ if numbered && at > 0 => order.swap(at - 1, at),
                _ => {}
            }
        }
        let mut assembler = Assembler::new(TURN_NS);
        let pushed = order.len() as u64;
        let out = sweeps(&mut assembler, order.into_iter().map(|index| {
            let mut beam = if numbered { beam(index) } else { running(index) };
            beam.azimuth = beam.azimuth.wrapping_add((index * 7919 % (jitter + 1)) as u32);
            beam
        }));
        assembler.restart(&mut |_| {});
        let given: u64 = out.iter().map(|scan| u64::from(scan.head.sweep.beam_count)).sum();
        let counted: u64 = ["beams_late", "beams_doubled", "beams_of_less_than_half_a_sweep", "beams_before_the_first_sweep"]
            .into_iter().map(|name| count(&assembler, name)).sum();
        let rest = count(&assembler, "beams") - pushed;
        // What restart gave was ignored here.
        prop_assert!(given + counted <= pushed + rest && given + counted + 220 >= pushed);
        for scan in &out {
            let beams = scan.head.sweep.beams();
            prop_assert!(beams.windows(2).all(|pair| pair[0].stamp_ns <= pair[1].stamp_ns + 1_000_000));
            prop_assert!(scan.items.windows(2).all(|pair| pair[0].beam <= pair[1].beam));
        }
    }

    #[test]
    fn no_beams_break_it(
        beams in prop::collection::vec((any::<u32>(), 0..220_u16, any::<u32>(), any::<i64>(), any::<i64>(), any::<bool>()), 1..700),
    ) {
        let mut assembler = Assembler::new(TURN_NS);
        sweeps(&mut assembler, beams.into_iter().map(|(sweep, number, azimuth, device_ns, arrival_ns, numbered)| RawBeam {
            position: if numbered { BeamPosition::Numbered { sweep: sweep % 4, beam: number } } else { BeamPosition::Running(number) },
            azimuth,
            device_ns: Some(device_ns),
            arrival_ns,
            ..beam(0)
        }));
    }
}
