//! Every fault of a radar, each for a second: it is counted, sweeps that it touched say so, and two seconds after it all is
//! well again. Prints a table.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use randt_emulator::FaultKind;
use randt_emulator::radar::{Format, Order};
use rustix::time::{ClockId, clock_gettime};
use support::{Emulator, Spoken, TURN_NS, count, free, log, now_ns, poll, radar};

/// The log lasts so many turns of 0.2 s.
const SWEEPS: usize = 27;
/// When the fault begins, s; half a second passes before the first beam.
const BEGIN_S: f64 = 1.7;
const DURATION_S: f64 = 1.0;
/// All is well again after this, s.
const BACK_S: f64 = 2.0;
/// At most so many at a time: each is a thousand wake-ups a second.
const AT_ONCE: usize = 4;

/// What is seen of a sweep.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Seconds since the emulator's beginning.
    at_s: f64,
    lost: u32,
    returns: usize,
    /// Between its end and the nearest end that the radar has.
    off_ns: i64,
}

struct Outcome {
    kind: FaultKind,
    spoken: Spoken,
    counter: &'static str,
    rise: u64,
    back_s: f64,
    processor: f64,
    flagged: usize,
    seen: Vec<Seen>,
}

/// What must rise; `None`: there is nothing of the kind in this protocol.
fn counter(kind: FaultKind, spoken: Spoken) -> Option<&'static str> {
    let tcp = matches!(spoken, Spoken::Navtech { .. });
    Some(match kind {
        FaultKind::Silence | FaultKind::Lost | FaultKind::Rate => "beams_lost",
        FaultKind::Close if tcp => "connections",
        FaultKind::Unplug if tcp => "connections",
        FaultKind::Unplug => "beams_lost",
        // TCP makes no difference, and neither must we.
        FaultKind::Split if tcp => "sweeps",
        FaultKind::Junk if tcp => "junk_bytes",
        FaultKind::Junk => "datagrams_of_another_protocol",
        FaultKind::Checksum if !tcp => "datagrams_damaged",
        FaultKind::Cut if tcp => "junk_bytes",
        FaultKind::Cut => "datagrams_damaged",
        FaultKind::Version if tcp => "messages_of_unknown_version",
        FaultKind::Version => "datagrams_of_unknown_version",
        FaultKind::Oversize if tcp => "messages_oversize",
        FaultKind::Oversize => "datagrams_damaged",
        FaultKind::Doubled => "beams_doubled",
        // TCP keeps the order.
        FaultKind::Reordered if !tcp => "beams_out_of_order",
        FaultKind::ClockReset => "clock_restarts",
        FaultKind::Contour | FaultKind::Jitter | FaultKind::Skew => "sweeps",
        _ => return None,
    })
}

/// Whether beams are missing while it lasts.
fn loses(kind: FaultKind) -> bool {
    use FaultKind::{Checksum, Cut, Lost, Oversize, Rate, Silence, Version};
    matches!(
        kind,
        Silence | Lost | Rate | Checksum | Cut | Version | Oversize
    )
}

fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn suffer(kind: FaultKind, spoken: Spoken, counter: &'static str) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let path = log(&folder, SWEEPS, true);
    let address = free(spoken);
    let mut radar = radar(spoken, address);
    let fault = format!("{}@{BEGIN_S}+{DURATION_S}", kind.name());
    let emulator = Emulator::start(path, spoken, address, &[&fault]);
    let pace = emulator.pace;
    let first_end_ns = pace.unix_ns(support::scan(0, true).head.sweep.end_ns);
    let mut seen = Vec::new();
    let (mut before, mut rise) = (0, 0);
    let (mut busy_s, mut processor) = (None, 0.0);
    poll(
        &mut radar,
        |sweep, at_ns| {
            let (_, end_ns) = sweep.span_ns();
            let off_ns = (end_ns - first_end_ns + TURN_NS / 2).rem_euclid(TURN_NS) - TURN_NS / 2;
            seen.push(Seen {
                at_s: (at_ns - now_ns()) as f64 * 1e-9 + pace.elapsed_s(),
                lost: sweep.beams_lost(),
                returns: sweep.len(),
                off_ns,
            });
        },
        |radar| {
            let at_s = pace.elapsed_s();
            if at_s < BEGIN_S {
                before = count(&radar.counters(), counter);
                busy_s = Some(processor_s());
            } else if at_s < BEGIN_S + DURATION_S {
                processor =
                    (processor_s() - busy_s.unwrap_or_default()) / (at_s - BEGIN_S).max(0.1);
            }
            if !emulator.is_over() {
                rise = count(&radar.counters(), counter) - before;
            }
            emulator.is_over()
        },
    );
    emulator.stop();
    let end_s = BEGIN_S + DURATION_S;
    let well = |sweep: &&Seen| sweep.at_s > end_s && sweep.lost == 0;
    let flagged = seen.iter().filter(|sweep| sweep.lost > 0).count();
    Outcome {
        kind,
        spoken,
        counter,
        rise,
        back_s: seen
            .iter()
            .find(well)
            .map_or(f64::INFINITY, |sweep| sweep.at_s - end_s),
        processor,
        flagged,
        seen,
    }
}

fn judge(outcome: &Outcome) {
    let Outcome {
        kind, spoken, seen, ..
    } = outcome;
    let what = format!("{kind:?} {spoken:?}");
    assert!(outcome.rise > 0, "{what}: {} did not rise", outcome.counter);
    assert!(
        outcome.back_s < BACK_S,
        "{what}: back after {} s",
        outcome.back_s
    );
    let after: Vec<&Seen> = seen
        .iter()
        .filter(|s| s.at_s > BEGIN_S + DURATION_S + BACK_S)
        .collect();
    assert!(
        after.len() >= 2 && after.iter().all(|sweep| sweep.lost == 0),
        "{what}: {after:?}"
    );
    // What a connection that ends takes with it is no more than a sweep that is not given.
    if !matches!(kind, FaultKind::Unplug | FaultKind::Close) {
        let flagged = outcome.flagged;
        assert_eq!(
            flagged > 0,
            loses(*kind),
            "{what}: {flagged} sweeps are flagged"
        );
    }
    // A third of it is this test's polling: the process's own share is measured with the whole pipeline.
    let processor = outcome.processor;
    assert!(processor < 0.15, "{what}: {processor} of a core");
    let whole = |sweep: &&Seen| sweep.lost == 0;
    let worst_ns = seen
        .iter()
        .filter(whole)
        .map(|sweep| sweep.off_ns.abs())
        .max();
    assert!(
        worst_ns.is_some_and(|ns| ns < 30_000_000),
        "{what}: {worst_ns:?} ns off"
    );
    if *kind == FaultKind::Contour {
        let least = seen.iter().map(|sweep| sweep.returns).min().unwrap();
        let most = seen.iter().map(|sweep| sweep.returns).max().unwrap();
        assert!(
            least > 0 && 2 * least < most,
            "{what}: {least} to {most} returns"
        );
    }
}

#[test]
fn every_fault_is_counted_and_over_two_seconds_after_it() {
    let wires = [
        Spoken::BeamUdp(Format::Sparse),
        Spoken::Navtech {
            sixteen: false,
            order: Order::Little,
        },
    ];
    let cases: Vec<(FaultKind, Spoken, &'static str)> = wires
        .into_iter()
        .flat_map(|spoken| FaultKind::ALL.iter().map(move |kind| (*kind, spoken)))
        .filter_map(|(kind, spoken)| Some((kind, spoken, counter(kind, spoken)?)))
        .collect();
    println!(
        "{:12} {:9} {:30} {:>7} {:>8} {:>7} {:>8}",
        "fault", "protocol", "counter", "rise", "back s", "cpu %", "flagged"
    );
    for group in cases.chunks(AT_ONCE) {
        let outcomes: Vec<Outcome> = std::thread::scope(|scope| {
            let threads: Vec<_> = group
                .iter()
                .map(|(kind, spoken, counter)| scope.spawn(|| suffer(*kind, *spoken, counter)))
                .collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap())
                .collect()
        });
        for outcome in &outcomes {
            let protocol = if matches!(outcome.spoken, Spoken::BeamUdp(_)) {
                "beam-udp"
            } else {
                "navtech"
            };
            println!(
                "{:12} {protocol:9} {:30} {:>7} {:>8.2} {:>7.1} {:>8}",
                outcome.kind.name(),
                outcome.counter,
                outcome.rise,
                outcome.back_s,
                outcome.processor * 100.0,
                outcome.flagged,
            );
        }
        outcomes.iter().for_each(judge);
    }
}
