//! `randt emulate radar`.

use super::Common;
use crate::exit::Outcome;
use crate::job;
use crate::output::print;
use anyhow::Context as _;
use clap::ValueEnum;
use randt_emulator::radar::{BeamUdpSender, Format, NavtechServer, Order};
use randt_emulator::{FaultKind, Pace, Recording};
use std::net::SocketAddr;

/// Arguments of `randt emulate radar`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// The radar's protocol, as radar.source names it
    #[arg(long)]
    proto: Protocol,
    /// navtech: where to listen, if not 127.0.0.1:6317; beam-udp: where to send, if not
    /// 127.0.0.1:6320, a group too
    #[arg(long, value_name = "IP:PORT")]
    address: Option<SocketAddr>,
    /// beam-udp: how values are written
    #[arg(long, value_name = "FORMAT", default_value = "sparse")]
    format: Values,
    /// navtech: bits of a bin
    #[arg(long, default_value = "8", value_parser = ["8", "16"])]
    bits: String,
    /// navtech: order of bytes in stamps
    #[arg(long, value_name = "ORDER", default_value = "le")]
    byte_order: Bytes,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Protocol {
    Navtech,
    BeamUdp,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Values {
    #[value(name = "u8")]
    Dense8,
    #[value(name = "u16")]
    Dense16,
    Sparse,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Bytes {
    Le,
    Be,
}

/// Emulates.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let common = &arguments.common;
    let faults = common.begin();
    match arguments.proto {
        Protocol::Navtech => faults.check("navtech", FaultKind::NOT_OF_NAVTECH)?,
        Protocol::BeamUdp => faults.check("beam-udp", FaultKind::NOT_OF_BEAM_UDP)?,
    }
    let recording = Recording::open(&common.log, common.endless)?;
    let pace = Pace::new(recording.begin_ns(), common.at);
    let ends = &job::interrupted;
    let address = |default: &str| match arguments.address {
        Some(address) => Ok(address),
        None => default.parse().context("an address"),
    };
    let sent = match arguments.proto {
        Protocol::Navtech => {
            let order = match arguments.byte_order {
                Bytes::Le => Order::Little,
                Bytes::Be => Order::Big,
            };
            let sixteen = arguments.bits == "16";
            let server = NavtechServer::new(address("127.0.0.1:6317")?, sixteen, order)?;
            print(&format!("navtech on {}\n", server.address()))?;
            server.play(recording, &pace, &faults, ends)?
        }
        Protocol::BeamUdp => {
            let format = match arguments.format {
                Values::Dense8 => Format::Dense8,
                Values::Dense16 => Format::Dense16,
                Values::Sparse => Format::Sparse,
            };
            let to = address("127.0.0.1:6320")?;
            let sender = BeamUdpSender::new(to, format)?;
            print(&format!("beam-udp to {to}\n"))?;
            sender.play(recording, &pace, &faults, ends)?
        }
    };
    print(&format!(
        "{} sweeps, {} beams; {} taken by nobody\n",
        sent.sweeps, sent.beams, sent.untaken
    ))?;
    Ok(Outcome::Good)
}
