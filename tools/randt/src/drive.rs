//! A simulated drive in memory, to be computed again and again.

use crate::job;
use anyhow::ensure;
use indicatif::ProgressBar;
use randt_geometry::Quaternion;
use randt_readers::{Counter, Error, Event, Extrinsics, InputInfo, Source};
use randt_simulator::{BeamSurface, Robot, Simulation, World};
use std::slice::Iter;

/// All events of a drive. Some 120 kB a sweep.
pub struct Drive {
    info: InputInfo,
    events: Vec<Event>,
    /// By the scan's sequence number.
    surfaces: Vec<Vec<BeamSurface>>,
}

impl Drive {
    /// Drives through a world; fails on Ctrl-C only.
    pub fn new(world: &World, scans: u64, seed: u64, bar: &ProgressBar) -> anyhow::Result<Self> {
        Self::with_robot(world, Robot::for_world(world), scans, seed, bar)
    }

    /// The same with another robot.
    pub fn with_robot(
        world: &World,
        robot: Robot,
        scans: u64,
        seed: u64,
        bar: &ProgressBar,
    ) -> anyhow::Result<Self> {
        let info = InputInfo {
            format: "simulation",
            sensor: robot.sensor(),
            scans: Some(scans),
            configuration: None,
            bin_size: None,
            without_intensity: None,
            topics: Vec::new(),
            extrinsics: Extrinsics {
                radar: Some(robot.radar_mounting),
                imu: Some(Quaternion::IDENTITY),
            },
        };
        let (mut events, mut surfaces) = (Vec::new(), Vec::new());
        let mut simulation = Simulation::new(world, robot, scans, seed).with_surfaces();
        while let Some(event) = simulation.next() {
            ensure!(!job::interrupted(), "interrupted; nothing was written");
            if matches!(event, Event::Scan(_)) {
                bar.inc(1);
                surfaces.push(simulation.surfaces().to_vec());
            }
            events.push(event);
        }
        bar.finish_and_clear();
        Ok(Self {
            info,
            events,
            surfaces,
        })
    }

    /// The walls that the beams of a scan show, by its sequence number; none of one that there is
    /// not.
    pub fn surfaces(&self, sequence: u64) -> &[BeamSurface] {
        let surfaces = usize::try_from(sequence).ok();
        surfaces
            .and_then(|index| self.surfaces.get(index))
            .map_or(&[], Vec::as_slice)
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
