//! A simulated drive in memory, to be computed again and again.

use crate::job;
use anyhow::ensure;
use indicatif::ProgressBar;
use randt_geometry::Quaternion;
use randt_readers::{Counter, Error, Event, Extrinsics, InputInfo, Source};
use randt_simulator::{Robot, Simulation, World};
use std::slice::Iter;

/// All events of a drive. Some 120 kB a sweep.
pub struct Drive {
    info: InputInfo,
    events: Vec<Event>,
}

impl Drive {
    /// Drives through a world; fails on Ctrl-C only.
    pub fn new(world: &World, scans: u64, seed: u64, bar: &ProgressBar) -> anyhow::Result<Self> {
        let robot = Robot::for_world(world);
        let info = InputInfo {
            format: "simulation",
            sensor: robot.sensor(),
            scans: Some(scans),
            configuration: None,
            extrinsics: Extrinsics {
                radar: Some(robot.radar_mounting),
                imu: Some(Quaternion::IDENTITY),
            },
        };
        let mut events = Vec::new();
        for event in Simulation::new(world, robot, scans, seed) {
            ensure!(!job::interrupted(), "interrupted; nothing was written");
            bar.inc(u64::from(matches!(event, Event::Scan(_))));
            events.push(event);
        }
        bar.finish_and_clear();
        Ok(Self { info, events })
    }

    /// The drive from its beginning, as if it were a log.
    pub fn source(&self) -> impl Source {
        Replay {
            info: &self.info,
            events: self.events.iter(),
        }
    }
}

/// The events that are still to come.
struct Replay<'a> {
    info: &'a InputInfo,
    events: Iter<'a, Event>,
}

impl Source for Replay<'_> {
    fn info(&self) -> &InputInfo {
        self.info
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        Ok(self.events.next().cloned())
    }

    fn counters(&self) -> Vec<Counter> {
        Vec::new()
    }
}
