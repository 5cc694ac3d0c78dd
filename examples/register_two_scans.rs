//! The motion between two scans of a recording, with its covariance: one registration, no map.
//!
//! ```text
//! cargo run -p randt-examples --bin register_two_scans -- DRIVE.mcap 20
//! ```

use anyhow::Context;
use randt_config::{Config, Selection};
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_messages::{Event, Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Odometry, Sink};
use randt_readers::{Options, Source};

/// Keeps every state.
#[derive(Default)]
struct States(Vec<OdometryState>);

impl Sink for States {
    fn state(&mut self, state: &OdometryState) {
        self.0.push(*state);
    }

    fn keyframe(&mut self, _keyframe: MessageRef<'_, Keyframe>) {}
}

fn main() -> anyhow::Result<()> {
    let usage = "usage: register_two_scans INPUT NUMBER: this scan and the next one";
    let mut arguments = std::env::args().skip(1);
    let input = arguments.next().context(usage)?;
    let number: usize = arguments.next().context(usage)?.parse().context(usage)?;

    let mut source = randt_readers::open(input.as_ref(), &Options::default())?;
    let config = Config::load(&Selection {
        sensor_from_input: source.info().sensor.name(),
        ..Selection::default()
    })?
    .config;
    let scans = filtered_scans(source.as_mut(), &config, number)?;

    // Two scans are all that this odometry ever sees: the second is registered to the first, both
    // de-skewed by the speed that the pair shows.
    let mut odometry = Odometry::new(&config, false);
    let mut states = States::default();
    for scan in &scans {
        odometry.push_points(scan.as_ref(), &mut states);
    }
    odometry.finish(&mut states);
    let [a, b] = states.0.as_slice() else {
        anyhow::bail!("scan {number} has too few returns to register to");
    };

    let motion = Pose2::from_array(a.pose).between(&Pose2::from_array(b.pose));
    let [xx, _, _, _, yy, _, _, _, yaw] = b.covariance;
    println!("x   {:+.4} m   +- {:.4}", motion.x_m, xx.sqrt());
    println!("y   {:+.4} m   +- {:.4}", motion.y_m, yy.sqrt());
    println!("yaw {:+.4} rad +- {:.4}", motion.yaw_rad, yaw.sqrt());
    println!("trust {}, fit {:.2}", b.trust().as_str(), b.fit);
    Ok(())
}

/// The filtered scans `number` and `number + 1`, from 0.
fn filtered_scans(
    source: &mut dyn Source,
    config: &Config,
    number: usize,
) -> anyhow::Result<Vec<Message<RadarPoints>>> {
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut filtered = Vec::new();
    let mut count = 0;
    while filtered.len() < 2 {
        let event = source.next_event()?;
        let event = event.with_context(|| format!("there are {count} scans only"))?;
        if let Event::Scan(scan) = event {
            if count >= number {
                let mut points = Message::<RadarPoints>::default();
                filter.process(scan.as_ref(), &mut points);
                filtered.push(points);
            }
            count += 1;
        }
    }
    Ok(filtered)
}
