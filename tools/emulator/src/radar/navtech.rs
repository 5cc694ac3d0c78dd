//! A radar that speaks Navtech's Colossus.

use super::fault_injector::Corruption;
use super::server::Server;
use super::turns::Turn;
use super::{Order, Sending, Sent, Wire, play};
use crate::wrong_content::WrongContent;
use crate::{Error, Faults, Pace, Recording};
use randt_messages::RadarScan;
use randt_radar::navtech::configuration::{Configuration, Details};
use randt_radar::navtech::fft::{Bins, DATA_OFFSET, Fft, STEP_16};
use randt_radar::navtech::frame::{Frame, HEADER_BYTES, VERSION, kind};
use std::f64::consts::TAU;
use std::net::SocketAddr;

/// Counts of the encoder in a turn, as all Navtechs have them.
const ENCODER_SIZE: u16 = 5600;

/// The fixed part of a configuration.
const CONFIGURATION_BYTES: usize = 20;

/// Serves a recording to up to three clients.
pub struct NavtechServer {
    server: Server,
    sixteen: bool,
    order: Order,
    configuration: Vec<u8>,
    powers: Vec<u8>,
    body: Vec<u8>,
}

impl NavtechServer {
    /// Listens. Powers have 8 or 16 bits; stamps have an order of bytes that clients must find
    /// out.
    pub fn new(address: SocketAddr, sixteen: bool, order: Order) -> Result<Self, Error> {
        Ok(Self {
            server: Server::new(address)?,
            sixteen,
            order,
            configuration: Vec::new(),
            powers: Vec::new(),
            body: Vec::new(),
        })
    }

    /// Where it listens, if port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.server.address()
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

    /// Sends the radar's configuration, where that is new: with a log's first sweep, or when it
    /// shows farther bins.
    fn configure(&mut self, turn: &Turn) {
        let configuration = configuration(turn, self.sixteen);
        self.body.clear();
        configuration.encode(&mut self.body);
        if self.body != self.configuration {
            self.configuration.clone_from(&self.body);
            self.server
                .configure(&message(kind::CONFIGURATION, &self.body));
        }
    }
}

fn configuration(turn: &Turn, sixteen: bool) -> Configuration {
    let turn_ns = turn.duration_ns().max(1);
    Configuration {
        azimuths: turn.beams,
        bin_size_01mm: (turn.bin_m * 1e4).round() as u16,
        // A round number, so that it rarely changes.
        bins: turn.bins.next_multiple_of(1000) as u16,
        encoder_size: ENCODER_SIZE,
        rotation_mhz: ((1e12 / turn_ns as f64) / 100.0).round() as u16 * 100,
        packets_per_s: (f64::from(turn.beams) * 1e9 / turn_ns as f64).round() as u16,
        range_gain: 1.0,
        // The client takes the bin's middle for its range.
        range_offset_m: ((turn.first_m - 0.5 * turn.bin_m) * 1e6).round() as f32 * 1e-6,
        details: Details {
            model: "emulated".to_owned(),
            mac: "02:00:00:00:00:01".to_owned(),
            data_width: Some(if sixteen { 2 } else { 1 }),
            range_resolution_m: Some(turn.bin_m as f32),
        },
    }
}

fn message(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut message = Vec::new();
    let version = VERSION;
    Frame {
        version,
        kind,
        payload,
    }
    .encode(&mut message);
    message
}

impl Wire for NavtechServer {
    fn encode(&mut self, beam: &Sending<'_>, messages: &mut Vec<Vec<u8>>) {
        self.configure(beam.turn);
        let width = if self.sixteen { 2 } else { 1 };
        self.powers.clear();
        self.powers.resize(beam.bins * width, 0);
        for item in beam.returns {
            let at = usize::from(item.bin) * width;
            let Some(bin) = self.powers.get_mut(at..at + width) else {
                continue;
            };
            if self.sixteen {
                let power = (item.intensity / STEP_16).round() as u16;
                bin.copy_from_slice(&power.to_be_bytes());
            } else {
                bin.fill(item.intensity.round() as u8);
            }
        }
        // The encoder counts clockwise.
        let counts = (-beam.azimuth_rad / TAU * f64::from(ENCODER_SIZE)).round() as i64;
        let fft = Fft {
            counter: beam.number as u16,
            azimuth: counts.rem_euclid(i64::from(ENCODER_SIZE)) as u16,
            time: self.order.encode(beam.device_ns),
            bins: if self.sixteen {
                Bins::Sixteen(&self.powers)
            } else {
                Bins::Eight(&self.powers)
            },
        };
        self.body.clear();
        fft.encode(&mut self.body);
        let kind = if self.sixteen {
            kind::FFT_16
        } else {
            kind::FFT_8
        };
        messages.push(message(kind, &self.body));
    }

    fn wrong(&self, beam: &[u8], wrong: &mut WrongContent) -> Vec<u8> {
        // Another configuration, a beam with another head, or another type of message.
        match wrong.below(3) {
            0 => {
                let mut payload = self.configuration.clone();
                let fixed = payload.len().min(CONFIGURATION_BYTES);
                wrong.change(payload.get_mut(..fixed).unwrap_or_default());
                message(kind::CONFIGURATION, &payload)
            }
            1 => {
                let mut beam = beam.to_vec();
                let head = HEADER_BYTES..HEADER_BYTES + usize::from(DATA_OFFSET);
                wrong.change(beam.get_mut(head).unwrap_or_default());
                beam
            }
            _ => {
                let payload = beam.get(HEADER_BYTES..).unwrap_or_default();
                let length = wrong.below(payload.len() as u64 + 1) as usize;
                let kind = wrong.below(256) as u8;
                message(kind, payload.get(..length).unwrap_or_default())
            }
        }
    }

    fn send(&mut self, message: &[u8]) -> bool {
        self.server.send(message)
    }

    fn idle(&mut self) {
        self.server.serve();
    }

    fn split(&mut self, split: bool) {
        self.server.split(split);
    }

    fn close(&mut self, message: &[u8]) {
        self.server.close_in(message);
    }

    fn unplug(&mut self, gone: bool) {
        self.server.unplug(gone);
    }

    fn corrupt(&self, corrupt: Corruption, message: &mut Vec<u8>) {
        match corrupt {
            // There is none.
            Corruption::Checksum => {}
            Corruption::Version => message.get_mut(16).map_or((), |version| *version = 9),
            Corruption::Oversize => message.get_mut(18).map_or((), |length| *length = 1),
        }
    }
}
