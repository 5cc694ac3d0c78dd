//! A device that sends text lines: on a serial port, where nobody configures it, or as datagrams.

use super::device::Device;
use super::{ImuMeasurement, ImuMeasurements};
use crate::pace::wait;
use crate::wrong_content::WrongContent;
use crate::{Error, FaultKind};
use randt_imu::line::{ImuLine, LINE_MAX, LineMessage, TwistLine};
use randt_messages::Twist;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::Duration;

/// How often the end is asked for.
const NAP: Duration = Duration::from_millis(20);
/// One of this many datagrams is corrupted, doubled or out of order.
const CORRUPTED_EVERY: u64 = 10;

/// The device. It is never asked for anything.
#[derive(Debug, Default)]
pub(super) struct LineDevice;

impl Device for LineDevice {
    fn take(&mut self, _: &[u8]) -> Vec<u8> {
        Vec::new()
    }

    fn message(&self, measurement: &ImuMeasurement, _: i64) -> Option<Vec<u8>> {
        Some(line(measurement).encode().into_bytes())
    }

    fn twist(&self, number: u64, device_ns: i64, twist: &Twist) -> Option<Vec<u8>> {
        let [forward, _, _, _, left, _, _, _, yaw] = twist.covariance;
        let line = TwistLine {
            sequence: Some(number as u16),
            stamp_ns: Some(device_ns.max(0)),
            velocity: twist.velocity,
            sigma: [forward, left, yaw].map(f64::sqrt),
        };
        Some(LineMessage::Twist(line).encode().into_bytes())
    }

    fn damage(&self, message: &mut [u8]) {
        // Not its end: the next line would be part of it.
        let middle = message.len() / 2;
        if let Some(byte) = message.get_mut(middle) {
            *byte ^= 1;
        }
    }

    fn wrong(&self, measurement: &ImuMeasurement, wrong: &mut WrongContent) -> Vec<u8> {
        let mut number = || wrong.below(2001) as f64 * 0.2 - 200.0;
        let three = [number(), number(), number()];
        let line = match wrong.below(4) {
            0 => LineMessage::Twist(TwistLine {
                sequence: Some(wrong.below(1 << 16) as u16),
                velocity: three,
                ..TwistLine::default()
            }),
            1 => LineMessage::Imu(ImuLine {
                sequence: Some(wrong.below(1 << 16) as u16),
                stamp_ns: Some((wrong.below(u64::MAX) >> 1) as i64),
                rate_rad_s: three,
                ..ImuLine::default()
            }),
            _ => {
                let mut body = line(measurement).to_string().into_bytes();
                wrong.change(&mut body);
                return [&body[..], b"\n"].concat();
            }
        };
        line.encode().into_bytes()
    }

    fn oversize(&self) -> &'static [u8] {
        &[b'1'; LINE_MAX + 2]
    }
}

fn line(measurement: &ImuMeasurement) -> LineMessage {
    LineMessage::Imu(ImuLine {
        sequence: Some(measurement.number as u16),
        stamp_ns: Some(measurement.device_ns.max(0)),
        rate_rad_s: measurement.rate_rad_s,
        acceleration_m_s2: measurement.acceleration_m_s2,
    })
}

/// The device's datagrams.
#[derive(Debug)]
pub struct LineSender {
    socket: UdpSocket,
    to: SocketAddr,
    /// A datagram that the next one overtakes.
    held: Option<Vec<u8>>,
}

impl LineSender {
    /// Sends to an address.
    pub fn open(to: SocketAddr) -> Result<Self, Error> {
        let any = (Ipv4Addr::UNSPECIFIED, 0);
        let socket = match to {
            SocketAddr::V4(_) => UdpSocket::bind(any),
            SocketAddr::V6(_) => UdpSocket::bind("[::]:0"),
        };
        Ok(Self {
            socket: socket.map_err(Error::io("a socket"))?,
            to,
            held: None,
        })
    }

    /// Plays all measurements, or until the end is asked for.
    pub fn run(
        &mut self,
        measurements: &mut ImuMeasurements,
        ends: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        let mut wrong = WrongContent::new(measurements.faults().seed());
        while let Some(measurement) = measurements.next_measurement()? {
            let due = measurements.pace().due(measurement.stamp_ns);
            if !wait(due, NAP, ends, || ()) {
                break;
            }
            let at_s = measurements.at_s(measurement.stamp_ns);
            let on = |kind| measurements.faults().is_on(kind, at_s);
            let corrupted = |kind| on(kind) && measurement.number.is_multiple_of(CORRUPTED_EVERY);
            if corrupted(FaultKind::Wrong) {
                self.send(LineDevice.wrong(&measurement, &mut wrong));
            }
            let is_silent = on(FaultKind::Silence) || on(FaultKind::Unplug);
            if is_silent || measurements.is_lost(&measurement) {
                continue;
            }
            let Some(mut message) = LineDevice.message(&measurement, 0) else {
                continue;
            };
            if corrupted(FaultKind::Checksum) {
                LineDevice.damage(&mut message);
            }
            if corrupted(FaultKind::Cut) {
                message.truncate(message.len() / 2);
            }
            if corrupted(FaultKind::Junk) {
                self.send(vec![0xFF, 0x00, 0x17]);
            }
            if corrupted(FaultKind::Oversize) {
                self.send(LineDevice.oversize().to_vec());
            }
            if corrupted(FaultKind::Doubled) {
                self.send(message.clone());
            }
            if corrupted(FaultKind::Reordered) {
                self.held = Some(message);
                continue;
            }
            self.send(message);
            if let Some(held) = self.held.take() {
                self.send(held);
            }
            while let Some((number, device_ns, twist)) = measurements.next_twist()? {
                LineDevice
                    .twist(number, device_ns, &twist)
                    .into_iter()
                    .for_each(|message| self.send(message));
            }
        }
        Ok(())
    }

    /// What nobody listens to is lost, as datagrams are.
    fn send(&self, message: Vec<u8>) {
        let _ = self.socket.send_to(&message, self.to);
    }
}
