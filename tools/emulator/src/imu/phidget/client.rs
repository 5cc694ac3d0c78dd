//! One client of the server.

use super::packet::{Packet, Parsed, encode, flags, kind, parse};
use super::spatial::{Channel, device};
use crate::imu::ImuMeasurement;
use crate::imu::device::is_asked_for;
use serde_json::Value;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};

/// A client that leaves this much unread is gone, bytes: ten seconds of measurements.
const WAITING_MAX: usize = 1 << 20;

/// A client.
#[derive(Debug)]
pub(super) struct Client {
    stream: TcpStream,
    received: Vec<u8>,
    waiting: Vec<u8>,
    number: u16,
    serial_number: u32,
    channel: Option<Channel>,
    gone: bool,
}

impl Client {
    /// One that is offered a device with this serial number.
    pub(super) fn new(stream: TcpStream, serial_number: u32) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            received: Vec::new(),
            waiting: Vec::new(),
            number: 0,
            serial_number,
            channel: None,
            gone: false,
        })
    }

    /// Whether it is to be forgotten.
    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }

    /// Reads and answers.
    pub(super) fn serve(&mut self) {
        let mut bytes = [0; 4096];
        loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => break self.gone = true,
                Ok(count) => self.received.extend(bytes.iter().take(count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => break self.gone = true,
            }
        }
        loop {
            match parse(&self.received) {
                Parsed::Incomplete => break,
                Parsed::Invalid => break self.gone = true,
                Parsed::Packet(packet, length) => {
                    self.received.drain(..length);
                    self.answer(&packet);
                }
            }
        }
    }

    fn answer(&mut self, packet: &Packet) {
        let asks: Value = serde_json::from_str(&packet.text).unwrap_or_default();
        let done = (kind::DONE, r#"{"E":0}"#.to_owned());
        let (kind, text) = match packet.kind {
            kind::HELLO => {
                let text = r#"{"type":"phid22device","pmajor":2,"pminor":4,"result":0}"#;
                (kind::HELLO_REPLY, text.to_owned())
            }
            kind::AUTHENTICATE => {
                let nonce = asks.get("nonceC").and_then(Value::as_str);
                let nonce = nonce.unwrap_or_default();
                let text = format!(
                    r#"{{"srvname":"randt","result":0,"nonceC":"{nonce}","nonceS":"abcdefghijklmno","salt":"onmlkjihgfedcba","count":1}}"#
                );
                (kind::CHALLENGE, text)
            }
            kind::KEEP_ALIVE => (kind::KEEP_ALIVE, String::new()),
            kind::OPEN => {
                let index = asks.get("index").and_then(Value::as_u64);
                let channel = Channel::open(self.serial_number, index.unwrap_or_default());
                (kind::BRIDGE, self.channel.insert(channel).status())
            }
            kind::CLOSE => {
                self.channel = None;
                done
            }
            kind::BRIDGE => {
                if let Some(channel) = &mut self.channel {
                    channel.configure(&asks);
                }
                done
            }
            // The proof of the password: this server has none.
            _ => done,
        };
        if packet.flags & flags::REQUEST != 0 {
            let reply = encode(flags::REPLY, 0, packet.number, kind, &text);
            self.waiting.extend(reply);
        }
        if packet.kind == kind::PROOF {
            self.send(flags::REQUEST, kind::DEVICE, &device(self.serial_number));
        }
    }

    fn send(&mut self, flags: u16, kind: (u8, u8), text: &str) {
        self.number = self.number.wrapping_add(1);
        self.waiting
            .extend(encode(flags, self.number, 0, kind, text));
    }

    /// Queues a measurement, if it was asked for.
    pub(super) fn measure(&mut self, measurement: &ImuMeasurement, interval_ns: i64) {
        let Some(channel) = &mut self.channel else {
            return;
        };
        if is_asked_for(measurement, interval_ns, channel.interval_ns()) {
            let text = channel.data(measurement);
            self.send(flags::EVENT, kind::BRIDGE, &text);
        }
        self.gone |= self.waiting.len() > WAITING_MAX;
    }

    /// Bytes that are no packet.
    pub(super) fn corrupt(&mut self, junk: &[u8]) {
        self.waiting.extend_from_slice(junk);
    }

    /// How much waits.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Sends this many bytes of what waits.
    pub(super) fn flush(&mut self, most: usize) {
        let now = self.waiting.get(..most).unwrap_or(&self.waiting);
        if now.is_empty() {
            return;
        }
        match self.stream.write(now) {
            Ok(count) => drop(self.waiting.drain(..count)),
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => self.gone = true,
        }
    }

    /// Closes the connection.
    pub(super) fn close(&mut self) {
        self.gone = true;
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}
