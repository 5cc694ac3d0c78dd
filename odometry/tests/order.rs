//! The result does not depend on how scans, IMU samples and twists interleave, nor on which waits
//! for the other.

use crate::support::{Input, Outcome, config_that_bridges_no_gap as config, inputs, shift};
use proptest::prelude::*;
use randt_messages::{ImuSample, ImuUse, Message, RadarPoints, Twist};
use randt_odometry::Odometry;
use std::sync::LazyLock;

const SECOND_NS: i64 = 1_000_000_000;

/// The streams of a drive with its faults, each in its own order: scans missing, the clock set
/// back, samples and twists missing, repeated and out of order.
struct Streams {
    scans: Vec<Message<RadarPoints>>,
    samples: Vec<ImuSample>,
    twists: Vec<Twist>,
}

static DRIVE: LazyLock<Streams> = LazyLock::new(|| {
    let mut all = inputs(90);
    // From here on the clock is 5000 s back.
    let set_back = crate::support::index_of(&all, 60) + 7;
    all[set_back..]
        .iter_mut()
        .for_each(|input| shift(input, -5000 * SECOND_NS));
    let (mut scans, mut samples, mut twists) = (Vec::new(), Vec::new(), Vec::new());
    for input in all {
        match input {
            Input::Points(scan) => scans.push(scan),
            Input::Imu(sample) => samples.push(sample),
            Input::Twist(twist) => twists.push(twist),
        }
    }
    scans.drain(30..36);
    samples.drain(800..840);
    samples.swap(300, 303);
    samples.insert(500, samples[498]);
    twists.drain(700..720);
    twists.swap(200, 203);
    twists.insert(300, twists[298]);
    Streams {
        scans,
        samples,
        twists,
    }
});

impl Streams {
    /// One interleaving. `ahead(n)` says by how many samples more than it must the IMU is ahead
    /// when scan n comes; where it is behind, the scan waits for the samples that it lacks. A scan
    /// that comes while another one waits would end that one's wait, so it is kept back.
    fn run(&self, ahead: impl FnMut(usize) -> i64) -> Outcome {
        self.run_with(&[], ahead)
    }

    /// The same with twists, which run ahead and behind less.
    fn run_with(&self, twists: &[Twist], mut ahead: impl FnMut(usize) -> i64) -> Outcome {
        let mut odometry = Odometry::new(&config(), true);
        let mut outcome = Outcome::default();
        let mut samples = self.samples.iter();
        let (mut pushed, mut pushed_twists) = (0, 0);
        let twists_per_scan = twists.len() as i64 / self.scans.len() as i64;
        let mut twists = twists.iter();
        for (n, scan) in self.scans.iter().enumerate() {
            // About as many samples as belong before this scan.
            let due = (n as i64 + 1) * self.samples.len() as i64 / self.scans.len() as i64;
            while pushed < due + ahead(n) {
                let Some(sample) = samples.next() else { break };
                odometry.push_imu(sample, &mut outcome);
                pushed += 1;
            }
            while pushed_twists < (n as i64 + 1) * twists_per_scan + ahead(n) / 10 {
                let Some(twist) = twists.next() else { break };
                odometry.push_twist(twist, &mut outcome);
                pushed_twists += 1;
            }
            while odometry.waiting_for_ns().is_some() {
                let (sample, twist) = (samples.next(), twists.next());
                if let Some(sample) = sample {
                    odometry.push_imu(sample, &mut outcome);
                    pushed += 1;
                }
                if let Some(twist) = twist {
                    odometry.push_twist(twist, &mut outcome);
                    pushed_twists += 1;
                }
                if sample.is_none() && twist.is_none() {
                    break;
                }
            }
            odometry.push_points(scan.as_ref(), &mut outcome);
        }
        samples.for_each(|sample| odometry.push_imu(sample, &mut outcome));
        twists.for_each(|twist| odometry.push_twist(twist, &mut outcome));
        odometry.finish(&mut outcome);
        outcome.counters = odometry.counters();
        outcome
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn every_interleaving_gives_the_same_bits(seed in any::<u64>(), spread in 1..400_i64) {
        let twists = if seed % 2 == 0 { &DRIVE.twists[..] } else { &[] };
        let plain = DRIVE.run_with(twists, |_| 0);
        // A small generator: the two streams run ahead of each other now and then.
        let mut random = seed | 1;
        let other = DRIVE.run_with(twists, |_| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            (random % (2 * spread as u64 + 1)) as i64 - spread
        });
        prop_assert_eq!(other.counters, plain.counters);
        prop_assert!(other.bytes == plain.bytes);
    }
}

#[test]
fn the_faults_are_met_and_counted() {
    let outcome = DRIVE.run(|_| 0);
    let (states, counters) = (&outcome.states, outcome.counters);
    assert_eq!(states.len(), 84);
    // A gap of scans and a clock set back.
    assert_eq!(counters.frames_reopened, 2);
    assert_eq!(counters.imu_rejected, 4);
    assert_eq!(counters.imu_holes, 1);
    let covered = states
        .iter()
        .filter(|state| state.imu_use == ImuUse::Covered as u32)
        .count();
    assert!(covered >= 80, "{covered} of 84 scans covered");
}

#[test]
fn a_scan_takes_the_samples_up_to_the_first_that_covers_it() {
    let outcome = DRIVE.run(|n| (n as i64 % 5) * 40);
    for state in &outcome.states {
        let used = DRIVE
            .samples
            .iter()
            .find(|sample| sample.header.sequence == state.imu_sequence)
            .unwrap();
        if state.imu_use == ImuUse::Covered as u32 {
            let beyond_ns = used.header.stamp_ns - state.header.stamp_ns;
            assert!((0..SECOND_NS / 5).contains(&beyond_ns), "{beyond_ns} ns");
            assert_eq!(state.imu_epoch, used.header.epoch);
        }
    }
}

#[test]
fn a_wait_that_is_over_shows_in_the_state() {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    let mut samples = DRIVE.samples.iter().take(200).peekable();
    for scan in &DRIVE.scans[..3] {
        let end_ns = scan.head.sweep.end_ns;
        // Half the sweep is covered.
        while let Some(sample) =
            samples.next_if(|sample| sample.header.stamp_ns < end_ns - SECOND_NS / 10)
        {
            odometry.push_imu(sample, &mut outcome);
        }
        odometry.push_points(scan.as_ref(), &mut outcome);
        assert_eq!(odometry.waiting_for_ns(), Some(end_ns));
        odometry.proceed(&mut outcome);
        assert_eq!(odometry.waiting_for_ns(), None);
        assert_eq!(outcome.states.last().unwrap().imu_use, ImuUse::Late as u32);
    }
    assert_eq!(outcome.counters.scans_imu_late, 0);
    assert_eq!(odometry.counters().scans_imu_late, 3);
}

#[test]
fn samples_without_scans_do_not_pile_up() {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    let mut sample = DRIVE.samples[0];
    for i in 0..20_000 {
        sample.header.stamp_ns += 4_000_000;
        sample.header.sequence = i;
        odometry.push_imu(&sample, &mut outcome);
    }
    let mut scan = DRIVE.scans[0].clone();
    let by_ns = sample.header.stamp_ns - SECOND_NS - scan.head.sweep.end_ns;
    crate::support::shift_scan(&mut scan, by_ns);
    odometry.push_points(scan.as_ref(), &mut outcome);
    assert_eq!(outcome.states[0].imu_use, ImuUse::Covered as u32);
    // The last second is still to come.
    assert!((19_740..19_752).contains(&outcome.states[0].imu_sequence));
}

/// Samples that were published too late are not used, live or from a log: what was computed live
/// is reproduced from the log, where the samples are available.
#[test]
fn what_was_published_too_late_is_not_used_however_it_is_read() {
    let end_ns = DRIVE.scans[9].head.sweep.end_ns;
    // The IMU's driver was stopped for 0.3 s; and then just long enough that only the sample at
    // the sweep's end is missing.
    late_samples(end_ns - 50_000_000..end_ns + 250_000_000, 50_000_000);
    late_samples(end_ns..end_ns + 160_000_000, 1);
}

/// `still`: what was measured in this time was published at its end. The IMU then ends at least
/// `short_min_ns` before scan 9.
fn late_samples(still: std::ops::Range<i64>, short_min_ns: i64) {
    let wait_ns = (config().odometry.imu_wait_max_s * 1e9) as i64;
    let mut scans: Vec<_> = DRIVE.scans[..14].to_vec();
    for scan in &mut scans {
        scan.head.scan_published_ns = scan.head.sweep.end_ns + 1_000_000;
    }
    let last_ns = scans[13].head.sweep.end_ns + 10_000_000;
    let samples = DRIVE
        .samples
        .iter()
        .filter(|sample| sample.header.stamp_ns < last_ns);
    let samples: Vec<ImuSample> = samples
        .map(|sample| {
            let mut sample = *sample;
            let at_ns = sample.header.stamp_ns;
            sample.header.published_ns = if still.contains(&at_ns) {
                still.end
            } else {
                at_ns
            } + 500_000;
            sample
        })
        .collect();
    let mut runs = Vec::new();
    // Live, by the time of publishing, with a clock that is late; and from a log, by the stamps.
    for live in [true, false] {
        let mut odometry = Odometry::new(&config(), true);
        let mut outcome = Outcome::default();
        let mut left = samples.iter().peekable();
        for scan in &scans {
            let now_ns = if live {
                scan.head.scan_published_ns
            } else {
                scan.head.sweep.end_ns
            };
            let until = |sample: &&ImuSample, now_ns| {
                let header = &sample.header;
                (if live {
                    header.published_ns
                } else {
                    header.stamp_ns
                }) <= now_ns
            };
            while let Some(sample) = left.next_if(|sample| until(sample, now_ns)) {
                odometry.push_imu(sample, &mut outcome);
            }
            odometry.push_points(scan.as_ref(), &mut outcome);
            if live {
                let end_ns = now_ns + wait_ns + 20_000_000;
                while let Some(sample) = left.next_if(|sample| until(sample, end_ns)) {
                    odometry.push_imu(sample, &mut outcome);
                    if odometry.waiting_for_ns().is_none() {
                        break;
                    }
                }
                if odometry.waiting_for_ns().is_some() {
                    odometry.proceed(&mut outcome);
                }
            }
        }
        left.for_each(|sample| odometry.push_imu(sample, &mut outcome));
        odometry.finish(&mut outcome);
        let late = outcome
            .states
            .iter()
            .filter(|state| state.imu_use == ImuUse::Late as u32);
        let late: Vec<u64> = late.map(|state| state.id).collect();
        assert_eq!(late, [9], "live: {live}");
        outcome.counters = odometry.counters();
        runs.push(outcome);
    }
    let [live, log] = &runs[..] else {
        panic!("two runs")
    };
    assert_eq!(live.counters, log.counters);
    assert!(live.bytes == log.bytes);
    let counters = live.counters;
    assert_eq!(counters.scans_imu_late, 1);
    assert_eq!(counters.imu_late_first_ns, scans[9].head.sweep.end_ns);
    let short_ns = short_min_ns..short_min_ns + 5_000_000;
    assert!(
        short_ns.contains(&counters.imu_late_short_ns),
        "{counters:?}"
    );
}

#[test]
fn a_sample_that_was_published_in_time_and_delivered_too_late_is_counted() {
    let mut odometry = Odometry::new(&config(), true);
    let mut outcome = Outcome::default();
    let mut scan = DRIVE.scans[0].clone();
    let end_ns = scan.head.sweep.end_ns;
    scan.head.scan_published_ns = end_ns + 1_000_000;
    let published = |sample: &ImuSample| {
        let mut sample = *sample;
        sample.header.published_ns = sample.header.stamp_ns + 500_000;
        sample
    };
    let mut samples = DRIVE.samples.iter().map(published).peekable();
    while let Some(sample) = samples.next_if(|sample| sample.header.stamp_ns < end_ns) {
        odometry.push_imu(&sample, &mut outcome);
    }
    odometry.push_points(scan.as_ref(), &mut outcome);
    odometry.proceed(&mut outcome);
    assert_eq!(outcome.states[0].imu_use, ImuUse::Late as u32);
    // Its publisher was interrupted between stamp and sending: a log of it has the sample in time.
    for sample in samples.by_ref().take(3) {
        odometry.push_imu(&sample, &mut outcome);
    }
    let counters = odometry.counters();
    assert_eq!(
        (counters.scans_imu_late, counters.scans_imu_overtaken),
        (1, 1)
    );
}
