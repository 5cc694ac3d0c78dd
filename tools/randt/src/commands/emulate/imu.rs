//! `randt emulate imu`.

use super::Common;
use crate::exit::Outcome;
use clap::ValueEnum;
use randt_emulator::imu::{ImuMeasurements, LineSender, PhidgetServer, SerialImu, SerialProtocol};
use randt_emulator::{FaultKind, Pace, Recording};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

/// Arguments of `randt emulate imu`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// The IMU's protocol, as imu.source names it
    #[arg(long, value_enum)]
    proto: Proto,
    /// mip, xsens, line: a link to the serial port, which stays when the port gets another name
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// phidget22: where the network server listens, 127.0.0.1:5661 if not given. line: where
    /// datagrams go; if not given, a serial port
    #[arg(long, value_name = "IP:PORT", conflicts_with = "link")]
    address: Option<SocketAddr>,
    /// phidget22: the device's serial number
    #[arg(long, value_name = "NUMBER", default_value_t = 123_456)]
    serial: u32,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Proto {
    /// A Phidgets Spatial behind a Phidget network server
    Phidget22,
    /// A MicroStrain on a pseudo-terminal
    Mip,
    /// An Xsens MTi on a pseudo-terminal
    Xsens,
    /// Any IMU that sends text lines (docs/lines.md), with the log's velocities
    Line,
}

/// The vendor's port.
const PHIDGET_SERVER: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 5661);

/// Emulates.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let faults = arguments.common.begin();
    match arguments.proto {
        Proto::Phidget22 => faults.check("phidget22", FaultKind::NOT_OF_PHIDGET)?,
        Proto::Mip => faults.check("mip", FaultKind::NOT_OF_SERIAL)?,
        Proto::Xsens => faults.check("xsens", FaultKind::NOT_OF_SERIAL)?,
        Proto::Line if arguments.address.is_some() => {
            faults.check("line by UDP", FaultKind::NOT_OF_LINE_BY_UDP)?;
        }
        Proto::Line => faults.check("line", FaultKind::NOT_OF_SERIAL)?,
    }
    let recording = Recording::open(&arguments.common.log, arguments.common.endless)?;
    let pace = Pace::new(recording.begin_ns(), arguments.common.at);
    let mut measurements = ImuMeasurements::new(recording, pace, faults);
    let ends: &dyn Fn() -> bool = &crate::job::interrupted;
    let protocol = match arguments.proto {
        Proto::Phidget22 => {
            let address = arguments.address.unwrap_or(PHIDGET_SERVER);
            let mut server = PhidgetServer::open(address, arguments.serial)?;
            eprintln!("Phidget network server: {}", server.address());
            server.run(&mut measurements, ends)?;
            return Ok(Outcome::Good);
        }
        Proto::Mip => SerialProtocol::Mip,
        Proto::Xsens => SerialProtocol::Xsens,
        Proto::Line => {
            let common = &arguments.common;
            measurements = measurements.with_twists(&common.log, common.endless)?;
            if let Some(to) = arguments.address {
                LineSender::open(to)?.run(&mut measurements, ends)?;
                return Ok(Outcome::Good);
            }
            SerialProtocol::Line
        }
    };
    let mut imu = SerialImu::open(protocol, arguments.link.as_deref())?;
    if let Some(path) = imu.path() {
        eprintln!("serial port: {}", path.display());
    }
    imu.run(&mut measurements, ends)?;
    Ok(Outcome::Good)
}
