//! A gate for loops of one's own: every candidate of a drive judged by another rule than the
//! mapper's, and the pose graph that follows from it.
//!
//! ```text
//! cargo run -p randt-examples --bin custom_loop_gate -- DRIVE.mcap
//! ```

use anyhow::Context;
use nalgebra::{Matrix3, Vector3};
use randt_config::{Config, Selection};
use randt_filter::ClusterFilter;
use randt_mapper::pose_graph::{Edge, PoseGraph};
use randt_mapper::{KeyframeIdx, LoopClosure, Mapper};
use randt_messages::{Event, Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Odometry, Sink};
use randt_readers::Options;

/// What odometry is taken to be off by from one keyframe to the next: m, m, rad.
const STEP_SIGMA: [f64; 3] = [0.03, 0.03, 0.005];
/// Least share of either keyframe's surroundings that the other one's explain.
const FIT_MIN: f64 = 0.6;
/// Largest standard deviation along the direction that the registration knows least, m.
const SIGMA_MAX_M: f64 = 0.1;

/// The gate: a good fit that leaves no direction open. What the mapper measured of a candidate
/// before it was refused is there; the rest is `None`, and such a candidate is not taken.
fn is_loop(closure: &LoopClosure) -> bool {
    let sigma_m = closure.scores.sigma_m;
    closure.scores.fit() >= FIT_MIN && sigma_m.is_some_and(|sigma_m| sigma_m <= SIGMA_MAX_M)
}

struct Map(Mapper);

impl Sink for Map {
    fn state(&mut self, _state: &OdometryState) {}

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.0.push(keyframe);
    }
}

fn main() -> anyhow::Result<()> {
    let input = std::env::args().nth(1);
    let mapper = driven(&input.context("usage: custom_loop_gate INPUT")?)?;

    // Keyframes by odometry, then the loops that this gate takes.
    let step = Matrix3::from_diagonal(&Vector3::from(
        STEP_SIGMA.map(|sigma| 1.0 / (sigma * sigma)),
    ));
    let mut graph = PoseGraph::default();
    let mut before = None;
    for (index, keyframe) in mapper.keyframes().iter().enumerate() {
        let node = graph.add_node(keyframe.odom_from_base)?;
        let follows = before.replace(keyframe);
        // Poses of two odometry frames are not comparable.
        let Some(follows) = follows.filter(|it| it.odom_frame_id == keyframe.odom_frame_id) else {
            continue;
        };
        graph.add_odometry(Edge {
            from: KeyframeIdx(index - 1),
            to: node,
            measured: follows.odom_from_base.between(&keyframe.odom_from_base),
            information: step,
        })?;
    }
    for closure in mapper.closures().iter().filter(|closure| is_loop(closure)) {
        graph.add_loop(Edge {
            from: closure.older,
            to: closure.newer,
            measured: closure.older_from_newer,
            information: closure.information,
        })?;
    }
    let report = graph.optimise()?;

    let moved = graph.poses().iter().zip(mapper.poses());
    let moved_m = moved.map(|(own, mapper)| {
        let (x_m, y_m) = (own.x_m - mapper.x_m, own.y_m - mapper.y_m);
        (x_m * x_m + y_m * y_m).sqrt()
    });
    println!("{} candidates", mapper.closures().len());
    println!("{} loops by this gate", graph.loops().len());
    println!("{} loops by the mapper's", mapper.accepted().count());
    println!("chi2 {:.1}, converged {}", report.chi2, report.converged);
    println!(
        "keyframes differ by {:.3} m at most",
        moved_m.fold(0.0, f64::max)
    );
    Ok(())
}

fn driven(input: &str) -> anyhow::Result<Mapper> {
    let mut source = randt_readers::open(input.as_ref(), &Options::default())?;
    let config = Config::load(&Selection {
        sensor_from_input: source.info().sensor.name(),
        // Every keyframe stays a node, so that the graphs can be compared one by one.
        set: vec!["loops.laps_max=0".to_owned()],
        ..Selection::default()
    })?
    .config;
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(&config, true);
    let mut map = Map(Mapper::new(&config));
    while let Some(event) = source.next_event()? {
        match event {
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut map);
            }
            Event::Imu(sample) => odometry.push_imu(&sample, &mut map),
            Event::Twist(twist) => odometry.push_twist(&twist, &mut map),
            Event::Truth(_) => {}
        }
    }
    odometry.finish(&mut map);
    map.0.finish();
    Ok(map.0)
}
