//! The server: connections, and the faults of a device behind one.

use super::client::Client;
use crate::imu::{ImuMeasurement, ImuMeasurements};
use crate::pace::wait;
use crate::{Error, FaultKind};
use std::net::{SocketAddr, TcpListener};
use std::time::Duration;

/// It answers within this time.
const ANSWER: Duration = Duration::from_millis(2);
/// One of this many messages is corrupted.
const CORRUPTED_EVERY: u64 = 10;
/// A packet begins with other bytes.
const JUNK: &[u8] = b"no packet";

/// A Phidget network server with one Spatial.
#[derive(Debug)]
pub struct PhidgetServer {
    address: SocketAddr,
    serial_number: u32,
    listener: Option<TcpListener>,
    clients: Vec<Client>,
}

impl PhidgetServer {
    /// Listens; the device has a serial number.
    pub fn open(address: SocketAddr, serial_number: u32) -> Result<Self, Error> {
        let listener = listen(address)?;
        let address = listener.local_addr();
        Ok(Self {
            address: address.map_err(Error::io("its own address"))?,
            serial_number,
            listener: Some(listener),
            clients: Vec::new(),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Plays all measurements, or until the end is asked for.
    pub fn run(
        &mut self,
        measurements: &mut ImuMeasurements,
        ends: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        let mut closed = 0;
        while let Some(measurement) = measurements.next_measurement()? {
            let at_s = measurements.at_s(measurement.stamp_ns);
            let on = |kind| measurements.faults().is_on(kind, at_s);
            let (unplugged, silent) = (on(FaultKind::Unplug), on(FaultKind::Silence));
            let close = measurements.faults().begun(FaultKind::Close, at_s) > closed;
            let due = measurements.pace().due(measurement.stamp_ns);
            let answer = || {
                if !silent {
                    self.serve()
                }
            };
            if !wait(due, ANSWER, ends, answer) {
                break;
            }
            if unplugged {
                self.kill();
                continue;
            }
            if self.listener.is_none() {
                self.listener = Some(listen(self.address)?);
                measurements.begin_clock(measurement.stamp_ns);
            }
            if close {
                closed += 1;
            }
            if !silent && !measurements.is_lost(&measurement) {
                self.send(&measurement, measurements, close);
            }
        }
        self.kill();
        Ok(())
    }

    fn kill(&mut self) {
        self.listener = None;
        self.clients.iter_mut().for_each(Client::close);
        self.clients.clear();
    }

    fn serve(&mut self) {
        self.accept();
        for client in &mut self.clients {
            client.serve();
        }
        self.clients.retain(|client| !client.is_gone());
    }

    fn accept(&mut self) {
        let Some(listener) = &self.listener else {
            return;
        };
        while let Ok((stream, _)) = listener.accept() {
            self.clients.extend(Client::new(stream, self.serial_number));
        }
    }

    fn send(&mut self, measurement: &ImuMeasurement, measurements: &ImuMeasurements, close: bool) {
        let at_s = measurements.at_s(measurement.stamp_ns);
        let on = |kind| measurements.faults().is_on(kind, at_s);
        let corrupted = |kind| on(kind) && measurement.number.is_multiple_of(CORRUPTED_EVERY);
        for client in &mut self.clients {
            if corrupted(FaultKind::Junk) {
                client.corrupt(JUNK);
            }
            client.measure(measurement, measurements.interval_ns());
            if corrupted(FaultKind::Doubled) {
                client.measure(measurement, measurements.interval_ns());
            }
            client.flush(match close || on(FaultKind::Split) {
                true => client.waiting() / 2,
                false => usize::MAX,
            });
            if close {
                client.close();
            }
        }
    }
}

fn listen(address: SocketAddr) -> Result<TcpListener, Error> {
    let what = || format!("listening on {address}");
    let listener = TcpListener::bind(address).map_err(Error::io(what()))?;
    listener.set_nonblocking(true).map_err(Error::io(what()))?;
    Ok(listener)
}
