//! `cargo bench -p randt-odometry`: how long the state takes to save and to restore, and how large
//! it is.
//!
//! After every scan of simulated drives: what a process does before it publishes.

use randt_config::{Config, Selection};
use randt_filter::ClusterFilter;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Error, Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, World};
use std::time::Instant;

const SCANS: u64 = 400;
/// Far more than any state has.
const ROOM: usize = 64 << 20;

struct Nowhere;

impl Sink for Nowhere {
    fn state(&mut self, _: &OdometryState) {}
    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (name, profile) in [
        ("building", "mixed"),
        ("building", "indoor"),
        ("yard", "outdoor"),
    ] {
        let config = Config::load(&Selection {
            profile: Some(profile.to_owned()),
            ..Selection::default()
        })?
        .config;
        let world = World::named(name).ok_or("no such world")?;
        print!("{name:<8} {profile:<7} ");
        measure(&world, &config)?;
    }
    Ok(())
}

fn measure(world: &World, config: &Config) -> Result<(), Error> {
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(config, true);
    let mut bytes = vec![0; ROOM];
    let (mut saves, mut restores, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    for event in Simulation::new(world, Robot::for_world(world), SCANS, 1) {
        match event {
            Event::Imu(sample) => odometry.push_imu(&sample, &mut Nowhere),
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut Nowhere);
                let begin = Instant::now();
                let length = odometry.save(&mut bytes)?;
                saves.push(begin.elapsed().as_nanos());
                lengths.push(length as u128);
                let begin = Instant::now();
                Odometry::restore(config, true, bytes.get(..length).unwrap_or_default())?;
                restores.push(begin.elapsed().as_nanos());
            }
            Event::Twist(_) | Event::Truth(_) => {}
        }
    }
    let percentiles = |values: &mut Vec<u128>, unit: f64| {
        values.sort_unstable();
        let at = |share: usize| {
            let index = (values.len() - 1) * share / 100;
            values.get(index).map_or(0.0, |v| *v as f64 / unit)
        };
        format!("{:.3} (p99 {:.3}, max {:.3})", at(50), at(99), at(100))
    };
    println!(
        "save {} ms, restore {} ms, {} kB",
        percentiles(&mut saves, 1e6),
        percentiles(&mut restores, 1e6),
        percentiles(&mut lengths, 1e3)
    );
    Ok(())
}
