//! A radar among other senders. Expected of each: the radar's own sweeps, contested where others
//! sent meanwhile.

use super::*;
use crate::Echo;
use proptest::prelude::*;
use randt_messages::{Message, RadarScan, SensorKind};

const BEAMS: i64 = 220;
const TURN_NS: i64 = 200_000_000;
const PATIENCE_NS: i64 = 1_000_000_000;
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
const BACK_MAX_NS: i64 = 2_000_000_000;

/// Beam `index` since the epoch, of a sender whose sweeps begin at a number.
fn beam(sender: u16, first_sweep: u32, index: i64) -> RawBeam {
    let at = index.rem_euclid(BEAMS);
    let since_ns = index * (TURN_NS / BEAMS);
    RawBeam {
        sender: Sender {
            device: 1,
            address: Some(([127, 0, 0, 1], 4000 + sender).into()),
        },
        fingerprint: u32::from(sender) << 16 | at as u32,
        position: BeamPosition::Numbered {
            sweep: first_sweep.wrapping_add(index.div_euclid(BEAMS) as u32),
            beam: at as u16,
        },
        azimuth: (at * (TURN / BEAMS)) as u32,
        device_ns: Some(5_000_000_000 + since_ns),
        arrival_ns: EPOCH_NS + since_ns,
        layout: BeamLayout {
            beams: BEAMS as u16,
            bin_m: 0.0161,
            ..BeamLayout::default()
        },
        echoes: vec![Echo {
            bin: at as u16 + 300 * sender,
            intensity: 10.0,
        }],
        ..RawBeam::default()
    }
}

fn radar(index: i64) -> RawBeam {
    beam(0, 1000, index)
}

/// Beams in the order of their arrival.
fn sweeps(streams: &mut Streams, mut beams: Vec<RawBeam>) -> Vec<Message<RadarScan>> {
    beams.sort_by_key(|beam| beam.arrival_ns);
    let mut out = Vec::new();
    for beam in &beams {
        streams.push(beam, &mut |sweep| {
            out.push(sweep.message(SensorKind::IsdrC))
        });
    }
    out
}

fn new() -> Streams {
    Streams::new(TURN_NS, PATIENCE_NS)
}

fn count(streams: &Streams, name: &str) -> u64 {
    let mut found = None;
    streams.counts(&mut |count| {
        if count.name == name {
            found = Some(count.value);
        }
    });
    found.unwrap()
}

fn contested(scans: &[Message<RadarScan>]) -> usize {
    let contested = scans.iter().filter(|scan| scan.head.sweep.is_contested());
    contested.count()
}

/// The same but for being contested.
fn assert_same(came: &[Message<RadarScan>], clean: &[Message<RadarScan>]) {
    assert_eq!(came.len(), clean.len());
    for (came, clean) in came.iter().zip(clean) {
        let mut came = came.clone();
        came.head.sweep.contested = 0;
        assert!(came == *clean);
    }
}

#[test]
fn a_radar_alone_is_taken_from_its_first_sweep_on() {
    let mut streams = new();
    let out = sweeps(&mut streams, (0..BEAMS * 5).map(radar).collect());
    assert_eq!((out.len(), contested(&out)), (5, 0));
    assert_eq!(streams.taken(), Some(radar(0).sender));
    assert_eq!(count(&streams, "beams_of_other_senders"), 0);
}

#[test]
fn one_beam_of_another_sender_before_the_radar_changes_nothing() {
    let clean = sweeps(&mut new(), (0..BEAMS * 5).map(radar).collect());
    let mut other_sender = beam(1, 7, 30);
    other_sender.sender.device = 99;
    other_sender.arrival_ns = EPOCH_NS - 3_000_000_000;
    let beams = (0..BEAMS * 5).map(radar).chain([other_sender]).collect();
    assert_eq!(sweeps(&mut new(), beams), clean);
}

#[test]
fn random_numbers_do_not_reach_the_radars_sweeps() {
    let clean = sweeps(&mut new(), (0..BEAMS * 50).map(radar).collect());
    // Five a second: from elsewhere, and with the radar's own address.
    for sender in [0, 1] {
        let mut random = 7_u64;
        let others = (0..50).map(|at| {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let mut beam = beam(sender, (random >> 32) as u32, at * BEAMS + 70);
            beam.fingerprint = random as u32;
            beam
        });
        let mut streams = new();
        let beams = (0..BEAMS * 50).map(radar).chain(others).collect();
        let out = sweeps(&mut streams, beams);
        assert_same(&out, &clean);
        assert!(contested(&out) >= 48, "{}", contested(&out));
        assert!(count(&streams, "beams_of_other_senders") >= 48);
        assert!(streams.other_sender().is_some());
    }
}

#[test]
fn of_two_whole_senders_the_first_is_taken_and_doubted_until_it_is_alone() {
    let ours = || (0..BEAMS * 30).map(radar);
    // It knows the numbers, and sends each sweep before the radar does.
    let theirs = (BEAMS * 10..BEAMS * 20).map(|index| {
        let mut beam = beam(1, 1000, index + 1);
        beam.arrival_ns -= TURN_NS;
        beam
    });
    let clean = sweeps(&mut new(), ours().collect());
    let mut streams = new();
    let out = sweeps(&mut streams, ours().chain(theirs).collect());
    assert_same(&out, &clean);
    let flags: Vec<bool> = out
        .iter()
        .map(|scan| scan.head.sweep.is_contested())
        .collect();
    assert!(flags[..9].iter().all(|is| !is) && flags[9..19].iter().all(|is| *is));
    assert!(flags[20..].iter().all(|is| !is), "{flags:?}");
    assert_eq!(streams.taken(), Some(radar(0).sender));
}

/// The address is copied too: which copy is the radar's cannot be known, but the sweep is
/// contested.
#[test]
fn copies_that_differ_contest_the_sweep() {
    for lead_ns in [0, 100_000, TURN_NS, 2 * TURN_NS] {
        let mut streams = new();
        let theirs = (BEAMS * 10..BEAMS * 40).map(|index| {
            let mut beam = radar(index);
            beam.fingerprint ^= 0x5555;
            beam.arrival_ns -= lead_ns;
            beam
        });
        let beams = (0..BEAMS * 40).map(radar).chain(theirs).collect();
        let out = sweeps(&mut streams, beams);
        let from_ns = EPOCH_NS + 10 * TURN_NS;
        let first = out.iter().find(|scan| scan.head.sweep.is_contested());
        let after_ns = first.unwrap().head.sweep.end_ns - from_ns;
        println!(
            "{lead_ns} ns ahead: contested after {after_ns} ns, {} of {} sweeps",
            contested(&out),
            out.len()
        );
        assert!(after_ns < BACK_MAX_NS);
        assert!(contested(&out) >= 20);
    }
}

#[test]
fn a_network_that_copies_beams_contests_nothing() {
    let copies = (0..BEAMS * 5).step_by(7).map(radar);
    let beams = (0..BEAMS * 5).map(radar).chain(copies).collect();
    let mut streams = new();
    let out = sweeps(&mut streams, beams);
    assert_eq!((out.len(), contested(&out)), (5, 0));
    assert!(count(&streams, "beams_doubled") > 100);
}

#[test]
fn a_radar_that_begins_anew_is_followed_with_its_first_sweep() {
    for (sender, first_sweep) in [(0, 0), (0, 500_000), (2, 1010), (2, 0)] {
        let mut streams = new();
        let again = (BEAMS * 12..BEAMS * 20).map(|index| {
            let mut beam = beam(sender, first_sweep, index);
            beam.arrival_ns += 300_000_000;
            beam.device_ns = Some(index * (TURN_NS / BEAMS));
            beam
        });
        let beams = (0..BEAMS * 10).map(radar).chain(again).collect();
        let out = sweeps(&mut streams, beams);
        assert_eq!(
            (out.len(), contested(&out)),
            (18, 0),
            "{sender} {first_sweep}"
        );
        assert_eq!(streams.taken().unwrap(), beam(sender, 0, 0).sender);
        assert_eq!(count(&streams, "sweeps"), 18);
        assert!(out.is_sorted_by_key(|scan| scan.head.sweep.end_ns));
    }
}

/// Another sender goes on with single beams under the address of a radar that is gone.
#[test]
fn a_sender_without_sweeps_is_replaced() {
    let single = (0..300).map(|at| {
        let mut beam = radar(BEAMS * 10 + at * BEAMS / 2);
        beam.fingerprint ^= 1;
        beam
    });
    let back = (BEAMS * 15..BEAMS * 40).map(|index| beam(3, 0, index));
    let beams = (0..BEAMS * 10)
        .map(radar)
        .chain(single)
        .chain(back)
        .collect();
    let mut streams = new();
    let out = sweeps(&mut streams, beams);
    let from_ns = EPOCH_NS + 15 * TURN_NS;
    let back = out
        .iter()
        .find(|scan| scan.head.sweep.begin_ns > from_ns - 1_000_000);
    let after_ns = back.unwrap().head.sweep.end_ns - from_ns;
    println!("back after {after_ns} ns");
    assert!(after_ns < BACK_MAX_NS);
}

#[test]
fn what_does_not_turn_is_no_radar() {
    for azimuth in [|_: u32| 77, |at: u32| at.wrapping_mul(0x9e37_79b9)] {
        let mut streams = new();
        let beams = (0..BEAMS * 10).map(|index| {
            let mut beam = radar(index);
            beam.azimuth = azimuth(index as u32);
            beam
        });
        assert_eq!(sweeps(&mut streams, beams.collect()).len(), 0);
        assert_eq!(streams.taken(), None);
        let out = sweeps(
            &mut streams,
            (BEAMS * 10..BEAMS * 20)
                .map(|index| beam(1, 0, index))
                .collect(),
        );
        assert_eq!(out.len(), 10);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// Other senders of any kind and number, at another address: the radar's sweeps are the same
    /// as without them.
    #[test]
    fn no_other_sender_reaches_the_radars_sweeps(
        others in prop::collection::vec((1..400_u16, any::<u32>(), 0..BEAMS * 20, any::<u32>(), 3..1024_u16), 0..400),
    ) {
        let clean = sweeps(&mut new(), (0..BEAMS * 20).map(radar).collect());
        let others = others.into_iter().map(|(sender, first_sweep, index, azimuth, beams)| {
            let mut beam = beam(1, first_sweep, index);
            beam.sender.address = Some(([127, 0, 0, 2], sender).into());
            beam.azimuth = azimuth;
            beam.layout.beams = beams.max(beam_of(&beam) + 1);
            beam
        });
        let beams = (0..BEAMS * 20).map(radar).chain(others).collect();
        assert_same(&sweeps(&mut new(), beams), &clean);
    }
}

fn beam_of(beam: &RawBeam) -> u16 {
    match beam.position {
        BeamPosition::Numbered { beam, .. } => beam,
        BeamPosition::Running(_) => 0,
    }
}
