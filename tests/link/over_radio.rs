//! A robot and a base with a bad radio between them, and how late things come.

use super::ends::{Base, Ends, Robot, keys};
use super::heard::Heard;
use crate::support::radio::{ADDRESS, Radio};
use crate::support::stages::program;
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// What came over the link late: of each kind the ages on arrival, sorted, s.
pub struct Ages(BTreeMap<&'static str, Vec<f64>>);

impl Ages {
    /// Of what came at the base after an instant of its clock. Stamps of both ends are the boot's
    /// clock plus an anchor each.
    pub fn new([robot, base]: &[Heard; 2], after_ns: i64) -> Self {
        let mut ages = BTreeMap::<_, Vec<f64>>::new();
        let sent: BTreeMap<(&str, u64), i64> = robot
            .came
            .iter()
            .rev()
            .map(|(kind, id, _, at_ns)| ((*kind, *id), *at_ns))
            .collect();
        for (kind, id, stamp_ns, at_ns) in base.came.iter().filter(|it| it.3 > after_ns) {
            let sent_ns = match stamp_ns {
                0 => sent.get(&(*kind, *id)).copied(),
                // Only the robot's stages.
                stamp_ns => robot
                    .stages
                    .values()
                    .any(|stage| stage.pid == *id)
                    .then_some(stamp_ns - robot.anchor_ns),
            };
            if let Some(sent_ns) = sent_ns {
                let ages = ages.entry(*kind).or_default();
                ages.push((at_ns - sent_ns) as f64 * 1e-9);
            }
        }
        ages.values_mut()
            .for_each(|ages| ages.sort_by(f64::total_cmp));
        Self(ages)
    }

    /// Prints them; gives the oldest.
    pub fn print(&self, what: &str) -> f64 {
        let mut oldest = 0.0_f64;
        for (kind, ages) in &self.0 {
            let at = |share: f64| ages[((ages.len() - 1) as f64 * share) as usize];
            println!(
                "{what}: {kind}: {} came, median {:.3} s, p99 {:.3}, oldest {:.3}",
                ages.len(),
                at(0.5),
                at(0.99),
                at(1.0)
            );
            oldest = oldest.max(at(1.0));
        }
        oldest
    }
}

pub fn now_ns(heard: &Heard) -> i64 {
    heard.observer.clock().now_ns() - heard.anchor_ns
}

pub fn listen_for(time: Duration, both: &mut [Heard; 2]) {
    let end = Instant::now() + time;
    while Instant::now() < end {
        both.iter_mut().for_each(Heard::listen);
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A robot that drives and a base, with a radio between them.
pub struct OverRadio {
    pub ends: Ends,
    pub both: [Heard; 2],
    pub radio: Radio,
    /// The robot's odometry and filter.
    pub stages: [u32; 2],
}

impl OverRadio {
    /// `None` where there can be none. `how`: the radio's settings from the start; `more`: as in
    /// [`Ends::new`], with the mapper not on the robot.
    pub fn new(input: &Path, how: &str, more: &str) -> Option<Self> {
        let mut radio = Radio::new()?;
        radio.set(how);
        let mut ends = Ends::at(&format!("{}:7447", ADDRESS[1]), more);
        let own = ends.folder.path().to_owned();
        for (end, name) in [(Robot, "spot"), (Base, "base")] {
            let folder = own.join("keys");
            keys(&folder, name, "10");
            let path = ends.configuration(end);
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(path, format!("{text}keys = {:?}\n", folder.join(name))).unwrap();
        }
        if more.is_empty() {
            ends.robot.mapper(&own.join("map.journal"));
        }
        let stages = ["odometry", "filter"].map(|name| ends.robot.stage(name));
        let program = program("link");
        ends.link_by(Base, radio.at(1, &program));
        ends.link_by(Robot, radio.at(0, &program));
        let both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
        ends.robot.play(input, &["--stay"]);
        Some(Self {
            ends,
            both,
            radio,
            stages,
        })
    }

    /// Kills one of the robot's stages and starts it again.
    pub fn restart(&mut self, name: &str) {
        let [odometry, filter] = &mut self.stages;
        let pid = if name == "odometry" { odometry } else { filter };
        self.ends.robot.end(*pid, Signal::KILL);
        *pid = self.ends.robot.stage(name);
    }

    pub fn has_all(both: &[Heard; 2]) -> bool {
        both[1].keyframe.len() == both[0].keyframe.len()
    }

    /// Bytes a second from the robot and back, and the ages, in some time from now on.
    pub fn measure(&mut self, what: &str, time: Duration) -> (f64, f64) {
        self.both.iter_mut().for_each(Heard::listen);
        let after_ns = now_ns(&self.both[1]);
        let before = self.radio.set("");
        listen_for(time, &mut self.both);
        let after = self.radio.set("");
        let rate = |way: usize| (after[way] - before[way]) as f64 / time.as_secs_f64();
        println!(
            "{what}: {:.0} B/s from the robot, {:.0} back",
            rate(0),
            rate(1)
        );
        let oldest = Ages::new(&self.both, after_ns).print(what);
        let [robot, base] = &self.both;
        println!(
            "{what}: keyframes {} of {}",
            base.keyframe.len(),
            robot.keyframe.len()
        );
        (oldest, rate(0))
    }
}
