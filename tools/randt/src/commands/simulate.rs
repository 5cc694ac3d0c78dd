//! `randt simulate`: a simulated drive as a log.

use crate::exit::Outcome;
use crate::input::number_within;
use crate::job;
use crate::output::{head_only, log_options, may_write, print, write_whole};
use crate::progress;
use anyhow::{Context as _, ensure};
use randt_config::NameOrFile;
use randt_evaluation::stamp_text;
use randt_geometry::Pose2;
use randt_log::{LogFile, ROBOT_METADATA};
use randt_messages::{ImuSampleTopic, TruthPose, TruthPoseTopic, TwistTopic};
use randt_simulator::{Event, Robot, Simulation, WheelProfile, World};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// A robot that comes nearer than this to a wall drives into it, m: half of a narrow one's width.
const CLEARANCE_MIN_M: f64 = 0.15;

/// Arguments of `randt simulate`.
#[derive(Debug, Default, clap::Args)]
#[command(group(clap::ArgGroup::new("drive").required(true).args(["world", "file"])))]
pub struct Arguments {
    /// The world to drive through: building, yard (sloping ground) or tunnel
    #[arg(hide_possible_values = true,
        value_parser = NameOrFile::new(World::NAMES.iter().copied()))]
    world: Option<String>,
    /// A world of your own, as docs/worlds.md says
    #[arg(long = "world", value_name = "FILE")]
    file: Option<PathBuf>,
    /// Log to write
    #[arg(long, value_name = "LOG.mcap")]
    out: PathBuf,
    /// Seed of everything random: the same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of radar sweeps, five a second; the route is driven again and again. By
    /// default two laps and a little more: building 2850, yard 1500, tunnel 1500
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    scans: Option<u64>,
    /// Also write the true poses at the sweeps' ends, as TUM rows
    #[arg(long, value_name = "FILE.tum")]
    truth: Option<PathBuf>,
    /// Where the radar sits in base_link: x and y in m, yaw in degrees
    #[arg(long, value_name = "X,Y,DEGREES", value_parser = mounting, allow_hyphen_values = true)]
    radar_mounting: Option<Pose2>,
    /// How late the radar's stamps are against the gyro's and the truth's, ms
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = lateness, allow_hyphen_values = true)]
    radar_late: f64,
    /// Wheel odometry at 50 Hz: its scale, how much more wheels turn in curves (0.05), its noise
    /// in m/s, and a fault (stuck, reversed, spinning) from some second on
    #[arg(long, value_name = "scale=S,slip=S,noise=N,fault=F,from=T")]
    wheels: Option<WheelProfile>,
    /// A drive for `randt calibrate`: the robot stops often and turns on the spot, to the left and
    /// to the right by turns
    #[arg(long)]
    turns: bool,
    /// Overwrite files that exist
    #[arg(long)]
    force: bool,
}

impl Arguments {
    /// A drive through a world; files that exist are overwritten.
    pub fn new(world: &str, out: PathBuf, seed: u64, scans: u64) -> Self {
        Self {
            world: Some(world.to_owned()),
            out,
            seed,
            scans: Some(scans),
            force: true,
            ..Self::default()
        }
    }
}

/// Simulates the drive and writes it.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let world = world(&arguments)?;
    for path in [&arguments.out].into_iter().chain(&arguments.truth) {
        may_write(path, arguments.force)?;
    }
    job::catch_interrupts();
    let robot = robot(&world, &arguments);
    let scans = arguments.scans.unwrap_or_else(|| world.sweeps());
    let mut log = LogFile::create(&arguments.out, log_options())?;
    log.write_metadata(ROBOT_METADATA, metadata(&robot).to_metadata())?;
    let about = [
        ("world", world.name.clone()),
        ("seed", arguments.seed.to_string()),
        ("scans", scans.to_string()),
    ];
    let about = about.map(|(key, value)| (key.to_owned(), value));
    log.write_metadata("randt/simulation", BTreeMap::from(about))?;

    let bar = progress::bar(Some(scans), "sweeps");
    let mut simulation = Simulation::new(&world, robot, scans, arguments.seed);
    let mut rows = String::new();
    let mut truth = TruthPose::default();
    let mut first_ns = None;
    let mut nearest = (f64::INFINITY, [0.0; 3]);
    for event in simulation.by_ref() {
        ensure!(!job::interrupted(), "interrupted; nothing was written");
        first_ns.get_or_insert(event.stamp_ns());
        match event {
            Event::Scan(scan) => {
                log.write(scan.as_ref())?;
                let [x_m, y_m, _] = truth.pose;
                let clearance_m = world.clearance_m([x_m, y_m].into());
                if clearance_m < nearest.0 {
                    nearest = (clearance_m, truth.pose);
                }
                if arguments.truth.is_some() {
                    tum_row(&mut rows, &truth);
                }
                bar.inc(1);
            }
            Event::Imu(sample) => log.write(head_only::<ImuSampleTopic>(&sample))?,
            Event::Twist(twist) => log.write(head_only::<TwistTopic>(&twist))?,
            Event::Truth(pose) => {
                log.write(head_only::<TruthPoseTopic>(&pose))?;
                truth = pose;
            }
        }
    }
    let bytes = log.finish()?;
    if let Some(path) = &arguments.truth {
        write_whole(path, rows.as_bytes())?;
    }
    bar.finish_and_clear();
    if nearest.0 < CLEARANCE_MIN_M {
        let (clearance_m, [x_m, y_m, _]) = nearest;
        eprintln!(
            "warning: the robot drives through a wall: it comes within {clearance_m:.2} m of one at {x_m:.1},{y_m:.1}; it rounds the route's corners, so give it more points there"
        );
    }
    let duration_s = (truth.header.stamp_ns - first_ns.unwrap_or_default()) as f64 * 1e-9;
    print(&format!(
        "{}: {} sweeps, {duration_s:.1} s, {:.1} m driven, {:.1} MB\n",
        arguments.out.display(),
        scans,
        simulation.path_m(),
        bytes as f64 * 1e-6,
    ))?;
    Ok(Outcome::Good)
}

/// The world that was asked for, by name or by file.
fn world(arguments: &Arguments) -> anyhow::Result<World> {
    if let Some(path) = &arguments.file {
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        return World::parse(&name, &text).with_context(|| path.display().to_string());
    }
    let name = arguments.world.as_deref().unwrap_or_default();
    World::named(name).with_context(|| {
        let names = World::NAMES.join(", ");
        format!("unknown world {name:?}: there is {names}; a file's goes to --world")
    })
}

/// The robot that was asked for.
fn robot(world: &World, arguments: &Arguments) -> Robot {
    let mut robot = Robot::for_world(world);
    robot.radar_mounting = arguments.radar_mounting.unwrap_or(robot.radar_mounting);
    robot.radar_late_ns = (arguments.radar_late * 1e6) as i64;
    robot.wheels = arguments.wheels;
    if arguments.turns {
        robot.motion = robot.motion.for_calibration();
    }
    robot
}

/// A pose on a robot.
fn mounting(text: &str) -> Result<Pose2, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .filter_map(|word| word.trim().parse().ok())
        .collect();
    match numbers[..] {
        [x_m, y_m, yaw_deg] if x_m.abs() <= 10.0 && y_m.abs() <= 10.0 && yaw_deg.abs() <= 360.0 => {
            Ok(Pose2::new(x_m, y_m, yaw_deg.to_radians()))
        }
        _ => Err("expected x and y within 10 m and a yaw in degrees, as 0.2,-0.1,3".to_owned()),
    }
}

/// What clocks are apart by.
fn lateness(text: &str) -> Result<f64, String> {
    number_within(
        text,
        -1000.0..=1000.0,
        "milliseconds between -1000 and 1000",
    )
}

/// The robot as the log has it.
fn metadata(robot: &Robot) -> randt_log::Robot {
    randt_log::Robot {
        sensor: robot.sensor(),
        radar: Some(robot.radar_mounting.to_array()),
        imu: Some([1.0, 0.0, 0.0, 0.0]),
    }
}

/// Stamp, position, quaternion: the orientation is a turn about z.
fn tum_row(rows: &mut String, truth: &TruthPose) {
    let pose = Pose2::from_array(truth.pose);
    let (sin, cos) = randt_geometry::elementary::sin_cos(0.5 * pose.yaw_rad);
    let (stamp, x_m, y_m) = (stamp_text(truth.header.stamp_ns), pose.x_m, pose.y_m);
    // Writing to a String cannot fail.
    let _ = writeln!(rows, "{stamp} {x_m:.9} {y_m:.9} 0 0 0 {sin:.12} {cos:.12}");
}
