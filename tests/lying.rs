//! Sensors that lie: how much of a drive is believed, and how wrong that part is.

use indicatif::ProgressBar;
use randt::{drive::Drive, job, trust_spans};
use randt_config::{Config, Selection};
use randt_evaluation::{SilentlyWrong, silently_wrong};
use randt_messages::{Message, RadarScan};
use randt_readers::{Counter, Error, Event, InputInfo, Source};
use randt_simulator::World;

/// A fault: changes an event at its time since the drive's begin, s, or leaves it out.
type Fault = Box<dyn FnMut(&mut Event, f64) -> bool>;

/// A source whose events a fault has changed.
struct Lying<S> {
    source: S,
    fault: Fault,
    begin_ns: Option<i64>,
}

impl<S: Source> Source for Lying<S> {
    fn info(&self) -> &InputInfo {
        self.source.info()
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        while let Some(mut event) = self.source.next_event()? {
            let stamp_ns = match &event {
                Event::Scan(scan) => scan.head.header.stamp_ns,
                Event::Imu(sample) => sample.header.stamp_ns,
                Event::Truth(pose) => pose.header.stamp_ns,
            };
            let begin_ns = *self.begin_ns.get_or_insert(stamp_ns);
            if (self.fault)(&mut event, (stamp_ns - begin_ns) as f64 * 1e-9) {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    fn counters(&self) -> Vec<Counter> {
        self.source.counters()
    }
}

/// A gyro that sends something else than the yaw rate, given that and the time, s.
fn gyro(mut lie: impl FnMut(f64, f64) -> f64 + 'static) -> Fault {
    Box::new(move |event, at_s| {
        if let Event::Imu(sample) = event {
            sample.rate_rad_s[2] = lie(sample.rate_rad_s[2], at_s);
        }
        true
    })
}

fn imu_upside_down() -> Fault {
    Box::new(|event, _| {
        if let Event::Imu(sample) = event {
            for axis in [1, 2] {
                sample.rate_rad_s[axis] = -sample.rate_rad_s[axis];
                sample.acceleration_m_s2[axis] = -sample.acceleration_m_s2[axis];
            }
        }
        true
    })
}

fn radar_mirrored() -> Fault {
    Box::new(|event, _| {
        if let Event::Scan(scan) = event {
            for beam in &mut scan.head.sweep.beams {
                beam.azimuth_rad = -beam.azimuth_rad;
            }
        }
        true
    })
}

/// The radar repeats one scan for that many seconds.
fn radar_frozen(from_s: f64, for_s: f64) -> Fault {
    let mut last: Option<Message<RadarScan>> = None;
    Box::new(move |event, at_s| {
        if let Event::Scan(scan) = event {
            match &last {
                Some(last) if (from_s..from_s + for_s).contains(&at_s) => {
                    scan.items.clone_from(&last.items);
                    let sweep = &mut scan.head.sweep;
                    sweep.beam_count = last.head.sweep.beam_count;
                    for (beam, old) in sweep.beams.iter_mut().zip(&last.head.sweep.beams) {
                        beam.azimuth_rad = old.azimuth_rad;
                        beam.first_return = old.first_return;
                    }
                }
                _ => last = Some(scan.clone()),
            }
        }
        true
    })
}

/// The robot is carried on for half a minute without a word.
fn kidnapped(from_s: f64) -> Fault {
    const CARRIED_S: f64 = 30.0;
    Box::new(move |event, at_s| {
        let by_ns = (CARRIED_S * 1e9) as i64;
        if at_s < from_s {
            return true;
        }
        match event {
            Event::Scan(scan) => {
                scan.head.header.stamp_ns -= by_ns;
                let sweep = &mut scan.head.sweep;
                sweep.begin_ns -= by_ns;
                sweep.end_ns -= by_ns;
                for beam in &mut sweep.beams {
                    beam.stamp_ns -= by_ns;
                }
            }
            Event::Imu(sample) => sample.header.stamp_ns -= by_ns,
            Event::Truth(pose) => pose.header.stamp_ns -= by_ns,
        }
        at_s >= from_s + CARRIED_S
    })
}

/// What a drive reports under a fault, as a row.
fn judged(name: &str, drive: &Drive, fault: Fault) -> SilentlyWrong {
    let mut source = Lying {
        source: drive.source(),
        fault,
        begin_ns: None,
    };
    let loaded = Config::load(&Selection::default()).unwrap();
    let mut config = job::with_mounting(loaded, &source).config;
    config.loops.enabled = false;
    let done = job::run(&mut source, &config, true, &ProgressBar::hidden()).unwrap();
    let spans = trust_spans::from_states(&done.results.states);
    let trust = trust_spans::for_evaluation(&spans);
    let results = &done.results;
    let found = silently_wrong(&results.odometry(), results.truth(), &trust);
    println!(
        "{name}: {:.1} % good, silent {} of {} m wrong of {}, worst 10 s of good ones {:.2} m",
        100.0 * found.good_share.unwrap(),
        found.silent_m,
        found.wrong_m,
        found.windows,
        found.worst_good_10s_m
    );
    found
}

#[test]
fn turned_and_mirrored_sensors_are_not_believed() {
    let drive = Drive::new(&World::building(), 300, 1, &ProgressBar::hidden()).unwrap();
    let share = |name, fault| judged(name, &drive, fault).good_share.unwrap();
    assert!(share("none", Box::new(|_, _| true)) > 0.99);
    assert!(share("IMU upside down", imu_upside_down()) < 0.6);
    assert!(share("sign of yaw", gyro(|rate, _| -rate)) < 0.6);
    assert!(share("radar mirrored", radar_mirrored()) < 0.6);
}

#[test]
#[ignore = "a table, a minute: cargo test --test programs lying:: -- --ignored --nocapture"]
fn what_is_believed_of_sensors_that_lie() {
    let drive = Drive::new(&World::building(), 1600, 1, &ProgressBar::hidden()).unwrap();
    let mut spikes = 0_u32;
    let spike = move |rate: f64, _: f64| {
        spikes += 1;
        if spikes.is_multiple_of(500) {
            rate + 5.0
        } else {
            rate
        }
    };
    let step_rad_s = 1_f64.to_radians();
    let faults: [(&str, Fault); 14] = [
        ("none", Box::new(|_, _| true)),
        ("IMU upside down", imu_upside_down()),
        ("sign of yaw", gyro(|rate, _| -rate)),
        ("radar mirrored", radar_mirrored()),
        (
            "gyro saturated at 0.35 rad/s",
            gyro(|rate, _| rate.clamp(-0.35, 0.35)),
        ),
        (
            "gyro frozen for 20 s",
            gyro({
                let mut held = 0.0;
                move |rate, at_s| {
                    if !(60.0..80.0).contains(&at_s) {
                        held = rate;
                    }
                    held
                }
            }),
        ),
        ("spikes of the gyro, 1 in 500", gyro(spike)),
        (
            "bias step of 1 deg/s at 60 s",
            gyro(move |rate, at_s| if at_s < 60.0 { rate } else { rate + step_rad_s }),
        ),
        ("radar frozen for 3 s", radar_frozen(60.0, 3.0)),
        ("radar frozen for 10 s", radar_frozen(60.0, 10.0)),
        ("kidnapped after 40 s", kidnapped(40.0)),
        ("kidnapped after 60 s", kidnapped(60.0)),
        ("kidnapped after 80 s", kidnapped(80.0)),
        ("scale of the gyro 2 % off", gyro(|rate, _| 1.02 * rate)),
    ];
    for (name, fault) in faults {
        judged(name, &drive, fault);
    }
}
