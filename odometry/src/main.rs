//! `randt-odometry`: radar/points and imu/sample to odometry/state and odometry/keyframe, as a process.

use clap::Parser;
use randt_messages::{
    ImuSampleTopic, Keyframe, MapperGraph, MessageRef, OdometryStateTopic, RadarPoints, Trust,
};
use randt_odometry::process::{Feed, Past};
use randt_stage::{Publisher, Stage, StageArguments, Subscriber, WakeReason, ended, parse};
use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Keyframes that are sent again for one request; the mapper asks for more when it has these.
const AGAIN: usize = 32;
/// The sections of the configuration that it computes by.
const READS: [&str; 8] = [
    "attitude", "filter", "keyframe", "ndt", "odometry", "robot", "sensor", "submap",
];
/// A start without a past waits so long to hear of a map that there may be from before.
const HEAR_MAX: Duration = Duration::from_secs(1);

/// The odometry stage: the live pose of every scan, and keyframes for the mapper.
///
/// What it knows lies in the run folder after every scan. When it is started again it goes on to the last bit; a build
/// or configuration of another kind keeps the pose and opens a new odometry frame.
#[derive(Debug, Parser)]
#[command(name = "randt-odometry", version, max_term_width = 100)]
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
        trust: "",
    };
    let mut past = Past::open(&mut stage)?;
    let (odometry, mut has_past) = past.restore(&stage, &config, use_imu)?;
    let samples = stage.subscriber::<ImuSampleTopic>()?;
    let points = stage.subscriber::<RadarPoints>()?;
    let mut graph = stage.subscriber::<MapperGraph>()?;
    let mut feed = Feed::new(odometry, past, samples, points, stage.clock());
    stage.running()?;
    out.publish(&mut feed.past)?;
    let mut late_said = 0;
    let give_up = Instant::now() + HEAR_MAX;
    while !has_past && Instant::now() < give_up {
        // Numbers go on after those of the map that there may be; the first scans lie in the buffer meanwhile.
        let left = give_up.saturating_duration_since(Instant::now());
        if stage.wait(&[&graph], Some(left))? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
        has_past = answer(&mut graph, &mut feed, &mut out, has_past)?;
    }
    loop {
        while feed.take()? {
            out.publish(&mut feed.past)?;
        }
        has_past |= answer(&mut graph, &mut feed, &mut out, has_past)?;
        report(&mut stage, &feed, &mut late_said);
        stage.set_status_note(out.trust);
        let pause = Some(feed.pause());
        if stage.wait(&[feed.wakes(), &graph], pause)? == WakeReason::Stop {
            return Ok(stage.close()?);
        }
    }
}

/// Hears what the mapper has and wants; gives whether it was heard.
fn answer(
    graph: &mut Subscriber<MapperGraph>,
    feed: &mut Feed,
    out: &mut Out,
    has_past: bool,
) -> Result<bool, Box<dyn Error>> {
    let mut wanted = None;
    let mut heard = false;
    while let Some(message) = graph.receive()? {
        let head = message.message().head;
        // Pages of the graph come between, and ask for nothing.
        if head.send_again == 1 {
            wanted = Some(head.wanted_keyframe);
        }
        heard = true;
        if head.wanted_keyframe > 0 && !has_past {
            // A map from before the machine was started: numbers go on after it.
            feed.odometry
                .continue_after(head.wanted_keyframe, head.odom_frame_id);
        }
    }
    if let Some(wanted) = wanted {
        let ring = feed.past.ring();
        // What the ring has beyond that belongs to a scan that is not kept yet. The one before goes with it: by that the
        // mapper sees whether both speak of the same drive.
        let next = feed.odometry.pose_record().next_keyframe;
        let there = (wanted.saturating_sub(1)..next).filter_map(|id| ring.get(id));
        for keyframe in there.take(AGAIN) {
            out.keyframes.publish(keyframe.as_ref())?;
        }
    }
    Ok(heard)
}

/// Tells what was lost on the way, and which scans had less of the IMU than there was.
fn report(stage: &mut Stage, feed: &Feed, late_said: &mut u64) {
    let lost = feed.scans_missed;
    let text = match lost {
        0 => String::new(),
        lost => format!("{lost} scans never came"),
    };
    stage.set_status(&text, lost);
    let late = feed.odometry.counters().scans_imu_late;
    if late > 0 {
        let text = format!("{late} scans without their last IMU samples");
        // A line in the journal for the first of them, and for as many again.
        if late >= *late_said * 2 {
            *late_said = late.max(1);
            stage.log_info(&text);
        }
        stage.set_remark(&text);
    }
}

/// The topics that it writes.
struct Out {
    states: Publisher<OdometryStateTopic>,
    keyframes: Publisher<Keyframe>,
    /// How far the newest pose can be believed, in words.
    trust: &'static str,
}

impl Out {
    /// Publishes what is in the outbox. It was kept before, and is sent again after a restart.
    fn publish(&mut self, past: &mut Past) -> Result<(), randt_stage::Error> {
        for state in past.outbox().take_states() {
            let items = &[];
            self.trust = match state.trust {
                trust if trust == Trust::Good as u32 => "trust good",
                trust if trust == Trust::Degraded as u32 => "trust degraded",
                _ => "lost",
            };
            self.states.publish(MessageRef { head: state, items })?;
        }
        while let Some(keyframe) = past.next_keyframe() {
            self.keyframes.publish(keyframe.as_ref())?;
        }
        Ok(())
    }
}
