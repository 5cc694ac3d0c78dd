//! `randt-ros1`: topics of ROS 1 to the pipeline's, and the pipeline's to ROS 1's, as a process.

mod frame;
mod node;

use clap::Parser;
use frame::Frame;
use node::Node;
use randt::input::InputOptions;
use randt::ros_topics::{LIVE_TOPICS, Topic};
use randt_readers::Encoding;
use randt_ros_bridge::{Inward, Outward};
use randt_ros_messages::Style;
use randt_stage::{StageArguments, Waitable, WakeReason, ended, parse, stop_requested};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// How often a node that has ended is looked after.
const TEND: Duration = Duration::from_millis(250);

/// Among ROS 1's nodes: takes sweeps, IMU samples and twists from its topics, and gives poses,
/// frames, path, grid, filtered sweeps and health.
///
/// Needs rospy of this machine's ROS, such as Debian's python3-rospy with python3-sensor-msgs,
/// python3-nav-msgs, python3-tf2-msgs and python3-diagnostic-msgs, and finds the master as every
/// node does (ROS_MASTER_URI, ROS_IP). A master or a node that ends is waited for.
#[derive(Debug, Parser)]
#[command(name = "randt-ros1", max_term_width = 100)]
struct Arguments {
    /// The Python that has rospy
    #[arg(long, value_name = "PROGRAM", default_value = "/usr/bin/python3")]
    python: PathBuf,
    #[command(flatten)]
    input: InputOptions,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("ros1", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = arguments.stage.selection.load(None)?.config;
    let options = arguments.input.options();
    let inputs = [
        &options.radar_topic,
        &options.imu_topic,
        &options.twist_topic,
    ];
    let mut topics: Vec<String> = inputs.into_iter().flatten().cloned().collect();
    let mut stage = arguments.stage.open("ros1")?;
    stage.expect_sensor(&config.sensor);
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["robot", "sensor"], None);
    let mut inward = match topics.is_empty() {
        // Drivers publish the same topics.
        true => None,
        false => Some(Inward::open(&mut stage, Encoding::Ros1, options)?),
    };
    let transforms = ["/tf_static", "/tf"].map(str::to_owned);
    topics.extend(transforms.into_iter().filter(|_| inward.is_some()));
    let mut outward = Outward::open(&mut stage, Style::Ros1, &config)?;
    // Of two nodes of one name the master ends the older one.
    let name = format!("{}_ros1", stage.domain().prefix());
    let mut node = Node::new(arguments.python.clone(), &name, topics, announcements());
    stage.running()?;
    // From now on SIGTERM is a request, also before the first wait.
    let mut is_over = stop_requested();
    while !is_over {
        let now_ns = stage.clock().now_ns();
        node.tend(now_ns);
        for frame in node.received() {
            if let Some(inward) = &mut inward {
                inward.take(&frame.topic, &frame.type_name, frame.time_ns, frame.message)?;
            }
        }
        outward.send(now_ns, |topic, name, message| {
            node.send(Frame {
                time_ns: message.stamp_ns,
                message: message.bytes,
                ..frame(topic, name)
            });
        })?;
        let lost = inward.as_ref().map_or(0, Inward::lost);
        let problem = inward.as_ref().and_then(|it| it.problem(&config.robot));
        let unsent = (node.unsent > 0).then(|| "the node of ROS does not take all".to_owned());
        let status = node.problem.clone().or(problem).or(unsent);
        stage.set_status(&status.unwrap_or_default(), lost + node.unsent);

        let descriptor = node.descriptor()?;
        let mut on: Vec<&dyn Waitable> = outward.waitables().to_vec();
        on.extend(descriptor.iter().map(|it| it as &dyn Waitable));
        is_over = stage.wait(&on, Some(TEND))? == WakeReason::Stop;
    }
    node.stop();
    Ok(stage.close()?)
}

/// What tells ROS of the topics before their first messages.
fn announcements() -> Vec<Frame> {
    let topics = LIVE_TOPICS.iter();
    let announced = topics.map(|(topic, name)| Frame {
        is_announcement: true,
        ..frame(topic, name)
    });
    announced.collect()
}

fn frame(topic: &Topic, name: &str) -> Frame {
    Frame {
        is_latched: topic.is_latched,
        topic: name.to_owned(),
        type_name: format!("{}/{}", topic.kind.package, topic.kind.name),
        ..Frame::default()
    }
}
