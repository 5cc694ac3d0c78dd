//! A radar that sends beam-udp.

use super::fault_injector::Corruption;
use super::{Format, Sending, Sent, Wire, play};
use crate::wrong_content::WrongContent;
use crate::{Error, Faults, Pace, Recording};
use randt_messages::RadarScan;
use randt_radar::Echo;
use randt_radar::beam_udp::packet::{DATAGRAM_MAX, HEADER_BYTES, Packet, crc32c, encode_value};
use std::f64::consts::TAU;
use std::net::{SocketAddr, UdpSocket};

/// The radar's number.
const DEVICE: u32 = 1;

/// Where a datagram's content begins: behind magic and version.
const CONTENT: usize = 5;
/// At a datagram's end.
const CHECKSUM_BYTES: usize = 4;

/// Sends a recording to an address, unicast or multicast.
pub struct BeamUdpSender {
    socket: UdpSocket,
    to: SocketAddr,
    format: Format,
    values: Vec<u8>,
}

impl BeamUdpSender {
    /// Sends from any free port.
    pub fn new(to: SocketAddr, format: Format) -> Result<Self, Error> {
        let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        // Loopback stays on it, multicast too.
        let from = if to.ip().is_loopback() {
            SocketAddr::new(to.ip(), 0)
        } else {
            any.parse().map_err(no_address)?
        };
        let socket = UdpSocket::bind(from).map_err(Error::io(format!("sending to {to}")))?;
        Ok(Self {
            socket,
            to,
            format,
            values: Vec::new(),
        })
    }

    /// Plays a recording until it is at its end, or `ends`.
    pub fn play(
        mut self,
        recording: Recording<RadarScan>,
        pace: &Pace,
        faults: &Faults,
        ends: &dyn Fn() -> bool,
    ) -> Result<Sent, Error> {
        play(&mut self, recording, pace, faults, ends)
    }

    /// The beam's values as the format has them: those of the bins, or of the returns.
    fn write_values(&mut self, beam: &Sending<'_>) {
        let format = self.format;
        self.values.clear();
        let returns = beam
            .returns
            .iter()
            .filter(|item| usize::from(item.bin) < beam.bins);
        let mut echoes = returns.map(|item| Echo {
            bin: item.bin,
            intensity: item.intensity,
        });
        if format == Format::Sparse {
            echoes.for_each(|echo| encode_value(format, echo, &mut self.values));
            return;
        }
        let mut next = echoes.next();
        for bin in 0..beam.bins {
            let loud = next.filter(|echo| usize::from(echo.bin) == bin);
            if loud.is_some() {
                next = echoes.next();
            }
            let silent = Echo {
                bin: bin as u16,
                intensity: 0.0,
            };
            encode_value(format, loud.unwrap_or(silent), &mut self.values);
        }
    }
}

fn no_address(error: std::net::AddrParseError) -> Error {
    Error::io("an address")(std::io::Error::other(error))
}

impl Wire for BeamUdpSender {
    fn encode(&mut self, beam: &Sending<'_>, messages: &mut Vec<Vec<u8>>) {
        self.write_values(beam);
        let fragment_bytes = self.format.values_max() * self.format.width();
        let fragments = self.values.len().div_ceil(fragment_bytes).max(1);
        for fragment in 0..fragments {
            let begin = fragment * fragment_bytes;
            let end = (begin + fragment_bytes).min(self.values.len());
            let packet = Packet {
                format: self.format,
                device: DEVICE,
                sweep: beam.turn.number,
                beam: beam.beam,
                beams: beam.turn.beams,
                fragment: fragment as u8,
                fragments: fragments as u8,
                first_bin: if self.format == Format::Sparse {
                    0
                } else {
                    (begin / self.format.width()) as u16
                },
                flags: 0,
                azimuth: (beam.azimuth_rad / TAU * 4_294_967_296.0).round() as i64 as u32,
                // 0 would mean that there is no clock.
                device_ns: beam.device_ns.max(1).unsigned_abs(),
                resolution_um: (beam.turn.bin_m * 1e6).round() as u32,
                offset_um: (beam.turn.first_m * 1e6).round() as i32,
                values: self.values.get(begin..end).unwrap_or_default(),
            };
            let mut message = Vec::with_capacity(DATAGRAM_MAX);
            packet.encode(&mut message);
            messages.push(message);
        }
    }

    fn send(&mut self, message: &[u8]) -> bool {
        self.socket.send_to(message, self.to).is_ok()
    }

    fn wrong(&self, message: &[u8], wrong: &mut WrongContent) -> Vec<u8> {
        let mut message = message.to_vec();
        let end = message.len().saturating_sub(CHECKSUM_BYTES);
        // The header behind magic and version; at times the values.
        let to = if wrong.below(4) == 0 {
            end
        } else {
            HEADER_BYTES
        };
        if let Some(content) = message.get_mut(CONTENT..to) {
            wrong.change(content);
        }
        message.truncate(end);
        message.extend_from_slice(&crc32c(&message).to_le_bytes());
        message
    }

    fn corrupt(&self, corrupt: Corruption, message: &mut Vec<u8>) {
        match corrupt {
            Corruption::Checksum => message.last_mut().map_or((), |last| *last ^= 0x55),
            Corruption::Version => message.get_mut(4).map_or((), |version| *version = 9),
            Corruption::Oversize => message.resize(2 * DATAGRAM_MAX, 0xaa),
        }
    }
}
