//! Radars: a log's sweeps, beam by beam at their times.

mod beam_udp;
mod device_time;
mod fault_injector;
mod navtech;
mod server;
mod turns;

pub use beam_udp::BeamUdpSender;
pub use navtech::NavtechServer;
pub use randt_radar::beam_udp::packet::Format;
pub use randt_radar::navtech::order::Order;

use crate::pace::wait;
use crate::wrong_content::WrongContent;
use crate::{Error, Faults, Pace, Recording};
use device_time::DeviceTime;
use fault_injector::FaultInjector;
use randt_messages::RadarScan;
use std::time::Duration;
use turns::{Turn, Turns};

/// How long a radar that serves clients may sleep, whatever is due: they are answered within this.
const NAP: Duration = Duration::from_millis(5);

/// What an emulator has sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Sweeps that were begun.
    pub sweeps: u64,
    /// Beams that were due.
    pub beams: u64,
    /// Messages that were not taken: no client, or the network refused them.
    pub untaken: u64,
}

/// A radar's side of a protocol. Its bytes come as whole messages, good or bad.
trait Wire {
    /// A beam as a message, or as several.
    fn encode(&mut self, beam: &Sending<'_>, messages: &mut Vec<Vec<u8>>);
    /// Sends a message, or what is to pass for one.
    fn send(&mut self, message: &[u8]) -> bool;
    /// Meanwhile.
    fn idle(&mut self) {}
    /// Sends in pieces of any size from now on, or not any more.
    fn split(&mut self, _split: bool) {}
    /// The connection ends in the middle of this message.
    fn close(&mut self, _message: &[u8]) {}
    /// The device is gone, or back.
    fn unplug(&mut self, _gone: bool) {}
    /// A message like this one, well-formed and with wrong content.
    fn wrong(&self, message: &[u8], wrong: &mut WrongContent) -> Vec<u8>;
    /// Corrupts a message in a way of this protocol.
    fn corrupt(&self, corrupt: fault_injector::Corruption, message: &mut Vec<u8>);
}

/// A beam as it is to be sent.
struct Sending<'a> {
    turn: &'a Turn,
    /// Its number in the sweep.
    beam: u16,
    /// Its number since the beginning.
    number: u64,
    azimuth_rad: f64,
    device_ns: i64,
    /// Bins from here on are not sent.
    bins: usize,
    returns: &'a [randt_messages::Return],
}

/// Plays a recording on a wire until it is at its end, or `ends`.
fn play(
    wire: &mut dyn Wire,
    recording: Recording<RadarScan>,
    pace: &Pace,
    faults: &Faults,
    ends: &dyn Fn() -> bool,
) -> Result<Sent, Error> {
    let begin_ns = recording.begin_ns();
    let mut turns = Turns::new(recording);
    let mut time = DeviceTime::default();
    let mut injector = FaultInjector::new(faults.clone());
    let mut sent = Sent::default();
    let mut messages = Vec::new();
    while let Some(turn) = turns.next_turn()? {
        sent.sweeps += 1;
        for beam in turn.beams() {
            if !wait(pace.due(beam.stamp_ns), NAP, ends, || wire.idle()) {
                return Ok(sent);
            }
            sent.beams += 1;
            let at_s = (beam.stamp_ns - begin_ns) as f64 * 1e-9;
            let now = injector.at(at_s, turn.step_rad());
            let unix_ns = pace.unix_ns(beam.stamp_ns + now.late_ns);
            let sending = Sending {
                turn: &turn,
                beam: beam.number,
                number: sent.beams - 1,
                azimuth_rad: beam.azimuth_rad + now.azimuth_rad,
                device_ns: time.device_ns(unix_ns, now.fast, now.resets),
                bins: turn.bins / if now.contour { 3 } else { 1 },
                returns: beam.returns,
            };
            messages.clear();
            wire.encode(&sending, &mut messages);
            sent.untaken += injector.send(wire, &mut messages, &now);
        }
    }
    Ok(sent)
}
