//! `randt-odometry`: radar/points, imu/sample and robot/twist to odometry/state and
//! odometry/keyframe, as a process.

use clap::Parser;
use randt_messages::{Keyframe, MapperGraph, MessageRef, OdometryStateTopic, TrustText};
use randt_odometry::GyroFault;
use randt_odometry::runtime::{CheckpointStore, Feed};
use randt_stage::{Publisher, Stage, StageArguments, Subscriber, WakeReason, ended, parse};
use std::error::Error;
use std::fmt::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Keyframes that are sent again for one request; the mapper asks for more when it has these.
const AGAIN: usize = 32;
/// The sections of the configuration that it reads.
const READS: [&str; 8] = [
    "attitude", "filter", "keyframe", "ndt", "odometry", "robot", "sensor", "submap",
];
/// A start without a saved state waits this long for the mapper, which may have a map from before.
const HEAR_MAX: Duration = Duration::from_secs(1);

/// The odometry stage: the live pose of every scan, and keyframes for the mapper.
///
/// Its state is saved in the run folder after every scan. When it is started again it goes on to
/// the last bit; another build or configuration keeps the pose and opens a new odometry frame.
#[derive(Debug, Parser)]
#[command(name = "randt-odometry", max_term_width = 100)]
struct Arguments {
    /// Do not use the IMU
    #[arg(long)]
    no_imu: bool,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("odometry", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = arguments.stage.selection.load(None)?.config;
    let use_imu = !arguments.no_imu;
    let mut stage = arguments.stage.open("odometry")?;
    stage.expect_sensor(&config.sensor);
    stage.follow_configuration(&arguments.stage.selection, &config, &READS, None);
    let mut out = Out {
        states: stage.publisher()?,
        keyframes: stage.publisher()?,
        trust: String::new(),
    };
    let mut store = CheckpointStore::open(&mut stage)?;
    let (odometry, mut has_predecessor) = store.restore(&stage, &config, use_imu)?;
    let inputs = (
        stage.subscriber()?,
        stage.subscriber()?,
        stage.subscriber()?,
    );
    let mut graph = stage.subscriber::<MapperGraph>()?;
    let mut feed = Feed::new(odometry, store, inputs, stage.clock());
    stage.running()?;
    out.publish(&mut feed.store)?;
    let mut logged = Logged::default();
    let give_up = Instant::now() + HEAR_MAX;
    while !has_predecessor && Instant::now() < give_up {
        // Numbers go on after those of a map from before; the first scans stay in the buffer
        // meanwhile.
        let left = give_up.saturating_duration_since(Instant::now());
        if stage.wait(&[&graph], Some(left))? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
        has_predecessor = answer(&mut graph, &mut feed, &mut out, has_predecessor)?;
    }
    loop {
        while feed.take()? {
            out.publish(&mut feed.store)?;
        }
        has_predecessor |= answer(&mut graph, &mut feed, &mut out, has_predecessor)?;
        set_status(&mut stage, &feed, &mut logged);
        stage.set_status_note(&out.trust);
        if feed.wait(&mut stage, &graph)? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
    }
}

/// Reads which keyframes the mapper has and lacks, and sends what it lacks; gives whether a
/// message came.
fn answer(
    graph: &mut Subscriber<MapperGraph>,
    feed: &mut Feed,
    out: &mut Out,
    has_predecessor: bool,
) -> Result<bool, Box<dyn Error>> {
    let mut wanted = None;
    let mut heard = false;
    while let Some(message) = graph.receive()? {
        let head = message.message().head;
        // Pages of the graph come in between and ask for nothing.
        if head.send_again == 1 {
            wanted = Some(head.wanted_keyframe);
        }
        heard = true;
        if head.wanted_keyframe > 0 && !has_predecessor {
            // A map from before the machine was started: numbers go on after it.
            feed.odometry
                .continue_after(head.wanted_keyframe, head.odom_frame_id);
        }
    }
    if let Some(wanted) = wanted {
        let ring = feed.store.ring();
        // What the ring has beyond that belongs to a scan that is not saved yet. The keyframe
        // before goes with it: it shows the mapper whether both are of the same drive.
        let next = feed.odometry.pose_record().next_keyframe;
        let there = (wanted.saturating_sub(1)..next).filter_map(|id| ring.get(id));
        for keyframe in there.take(AGAIN) {
            out.keyframes.publish(keyframe.as_ref())?;
        }
    }
    Ok(heard)
}

/// Sets the status: scans that never came, scans for which IMU samples came too late, what is wrong
/// with the IMU, and wheels that do not say the truth.
fn set_status(stage: &mut Stage, feed: &Feed, logged: &mut Logged) {
    let lost = feed.scans_missed;
    let text = match lost {
        0 => String::new(),
        lost => format!("{lost} scans never came"),
    };
    stage.set_status(&text, lost);
    let counters = feed.odometry.counters();
    let late = counters.scans_imu_late;
    let mut remark = String::new();
    if counters.scans_mounting_off > 0 {
        remark = counters.mounting_text();
    }
    if counters.scans_twist_refused > 0 {
        remark = counters.twist_refused_text();
    }
    if late > 0 {
        remark = format!("{late} scans without their last IMU samples");
        // A line in the journal for the first of them, and for as many again.
        if late >= logged.late * 2 {
            logged.late = late.max(1);
            stage.log_info(&remark);
        }
    }
    if counters.has_imu_fault() {
        remark = counters.imu_text();
        // Another fault is another line.
        let kind = (counters.gyro_fault, counters.gyro_bias_changes > 0);
        if logged.imu != kind {
            logged.imu = kind;
            stage.log_info(&remark);
        }
    }
    if !remark.is_empty() {
        stage.set_remark(&remark);
    }
}

/// What of the IMU the journal has.
#[derive(Default)]
struct Logged {
    /// Scans whose samples came too late.
    late: u64,
    /// The gyro's fault, and whether its bias has moved.
    imu: (GyroFault, bool),
}

/// The topics that it writes.
struct Out {
    states: Publisher<OdometryStateTopic>,
    keyframes: Publisher<Keyframe>,
    /// How far the newest pose can be believed, in words.
    trust: String,
}

impl Out {
    /// Publishes the outbox. It was saved before, and is sent again after a restart.
    fn publish(&mut self, store: &mut CheckpointStore) -> Result<(), randt_stage::Error> {
        for state in store.outbox().take_states() {
            let items = &[];
            self.trust.clear();
            // Writing to a String cannot fail.
            let _ = write!(self.trust, "trust {}", TrustText::new(state));
            self.states.publish(MessageRef { head: state, items })?;
        }
        while let Some(keyframe) = store.next_keyframe() {
            self.keyframes.publish(keyframe.as_ref())?;
        }
        Ok(())
    }
}
