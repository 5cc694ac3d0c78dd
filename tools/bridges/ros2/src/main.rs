//! `randt-ros2`: topics of ROS 2 to the pipeline's, and the pipeline's to ROS 2's, as a process.

mod actions;
mod bell;
mod bytes;
mod loopback;
mod names;
mod node;
mod participant;
mod service;
mod subscription;

use actions::{Actions, SERVICES};
use clap::Parser;
use node::{Node, NodeOptions};
use randt::input::InputOptions;
use randt::missions::ROOT;
use randt_readers::Encoding;
use randt_ros_bridge::{Inward, Outward};
use randt_ros_messages::Style;
use randt_stage::{Stage, StageArguments, Waitable, WakeReason, ended, parse, stop_requested};
use std::error::Error;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// How often it is looked at who else is there, and what is wrong: not with every IMU sample.
const TEND: Duration = Duration::from_millis(100);

/// Among ROS 2's nodes, by DDS: takes sweeps, IMU samples and twists from their topics, and gives
/// poses, frames, path, grid, filtered sweeps and health.
///
/// Speaks to nodes of this machine only, unless --network or --all-networks says where else. Needs
/// nothing of ROS itself.
#[derive(Debug, Parser)]
#[command(name = "randt-ros2", max_term_width = 100)]
struct Arguments {
    /// ROS's domain; if not given, ROS_DOMAIN_ID, or 0
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(..=232))]
    domain: Option<u16>,
    /// Address of this machine in whose network it takes part; can be given several times; if not
    /// given, 127.0.0.1
    #[arg(long, value_name = "ADDRESS", conflicts_with = "all_networks")]
    network: Vec<IpAddr>,
    /// Takes part in every network of this machine
    #[arg(long)]
    all_networks: bool,
    /// Namespace of all its topics, those of tf too, and of its services
    #[arg(long, value_name = "NAME", default_value = "", value_parser = names::namespace)]
    namespace: String,
    /// The release of ROS 2 whose tools see this node; if not given, ROS_DISTRO, or jazzy
    #[arg(long, value_name = "NAME")]
    distro: Option<String>,
    /// Offers services that begin and stop missions and wait until all is on the disk
    #[arg(long)]
    services: bool,
    /// Folder of the missions
    #[arg(long, value_name = "DIR", default_value = ROOT, requires = "services")]
    missions: PathBuf,
    #[command(flatten)]
    input: InputOptions,
    #[command(flatten)]
    stage: StageArguments,
}

impl Arguments {
    fn node(&self) -> Result<NodeOptions, Box<dyn Error>> {
        let named = |name: &str| std::env::var(name).ok().filter(|text| !text.is_empty());
        let domain = match (self.domain, named("ROS_DOMAIN_ID")) {
            (Some(domain), _) => domain,
            (None, Some(text)) => text
                .parse()
                .map_err(|error| format!("ROS_DOMAIN_ID {text:?}: {error}"))?,
            (None, None) => 0,
        };
        let distro = self.distro.clone().or_else(|| named("ROS_DISTRO"));
        let is_old = ["foxy", "galactic", "humble"].contains(&distro.as_deref().unwrap_or(""));
        Ok(NodeOptions {
            domain,
            networks: match (self.all_networks, self.network.as_slice()) {
                (true, _) => Vec::new(),
                (false, []) => vec![Ipv4Addr::LOCALHOST.into()],
                (false, given) => given.to_vec(),
            },
            namespace: self.namespace.clone(),
            gid_bytes: if is_old { 24 } else { 16 },
        })
    }
}

fn main() -> ExitCode {
    ended("ros2", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = arguments.stage.selection.load(None)?.config;
    let options = arguments.input.options();
    let node_options = arguments.node()?;
    let inputs = [
        &options.radar_topic,
        &options.imu_topic,
        &options.twist_topic,
    ];
    let mut topics: Vec<String> = inputs.into_iter().flatten().cloned().collect();
    let mut stage = arguments.stage.open("ros2")?;
    stage.expect_sensor(&config.sensor);
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["robot", "sensor"], None);
    let mut inward = match topics.is_empty() {
        // Drivers publish the same topics.
        true => None,
        false => Some(Inward::open(&mut stage, Encoding::Cdr, options)?),
    };
    let transforms = ["/tf_static", "/tf"].map(|name| format!("{}{name}", node_options.namespace));
    topics.extend(transforms.into_iter().filter(|_| inward.is_some()));
    let mut outward = Outward::open(&mut stage, Style::Cdr, &config)?;
    let services = if arguments.services {
        &SERVICES[..]
    } else {
        &[]
    };
    let mut actions = actions(&stage, arguments)?;
    let name = format!("{}_ros2", stage.domain().prefix());
    let mut node = Node::new(node_options, &name, topics, services)?;
    stage.running()?;
    // From now on SIGTERM is a request, also before the first wait.
    let (mut is_over, mut due_ns) = (stop_requested(), i64::MIN);
    while !is_over {
        let now_ns = stage.clock().now_ns();
        let is_due = now_ns >= due_ns;
        if is_due {
            due_ns = now_ns + TEND.as_nanos() as i64;
            node.tend(now_ns);
        }
        for received in node.received()? {
            if let Some(inward) = &mut inward {
                inward.take(
                    &received.topic,
                    &received.type_name,
                    now_ns,
                    received.message,
                )?;
            }
        }
        outward.send(now_ns, |topic, name, message| {
            node.send(topic, name, message.bytes);
        })?;
        if is_due {
            actions.tend(&node, outward.kept());
            let problem = inward.as_ref().and_then(|it| it.problem(&config.robot));
            let status = node.problem().or(problem);
            let lost = inward.as_ref().map_or(0, Inward::lost) + node.lost();
            stage.set_status(&status.unwrap_or_default(), lost);
        }

        let descriptor = node.descriptor()?;
        let mut on: Vec<&dyn Waitable> = outward.waitables().to_vec();
        on.push(&descriptor);
        is_over = stage.wait(&on, Some(TEND))? == WakeReason::Stop;
    }
    drop(node);
    Ok(stage.close()?)
}

/// The services' work, by the command line that stands beside this program.
fn actions(stage: &Stage, arguments: &Arguments) -> std::io::Result<Actions> {
    let program = std::env::current_exe()?.with_file_name("randt");
    let domain = stage.domain();
    let options = [
        ("--prefix", domain.prefix().to_owned()),
        ("--run", domain.run().display().to_string()),
        ("--root", arguments.missions.display().to_string()),
    ];
    let options = options.map(|(name, value)| format!("{name}={value}"));
    Ok(Actions::new(program, options.to_vec()))
}
