//! The TCP side of a Navtech: clients that come, ask and go.

use crate::Error;
use randt_radar::navtech::frame::{FrameParser, VERSION, command, kind};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// More are not served (Navtech's Colossus).
const CLIENTS_MAX: usize = 3;
/// Between the radar's signs of life.
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// What a client may be behind, bytes, before it is taken for dead: two seconds.
const BEHIND_MAX: usize = 16 << 20;
/// Where messages are sent in pieces: bytes that wait for the next piece.
const SPLITS: [usize; 5] = [1, 700, 23, 3000, 5];

/// Listens, and sends to the clients that asked for beams.
pub(crate) struct Server {
    listener: Option<TcpListener>,
    address: SocketAddr,
    clients: Vec<Client>,
    configuration: Vec<u8>,
    split: bool,
}

/// A client.
struct Client {
    stream: TcpStream,
    parser: FrameParser,
    wants_beams: bool,
    configured: bool,
    outgoing: Vec<u8>,
    splits: usize,
    keep_alive: Instant,
    gone: bool,
}

impl Server {
    pub fn new(address: SocketAddr) -> Result<Self, Error> {
        let mut server = Self {
            listener: None,
            address,
            clients: Vec::new(),
            configuration: Vec::new(),
            split: false,
        };
        let listening = server.listen();
        listening.map_err(Error::io(format!("listening on {address}")))?;
        Ok(server)
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    fn listen(&mut self) -> std::io::Result<()> {
        let listener = TcpListener::bind(self.address)?;
        listener.set_nonblocking(true)?;
        self.address = listener.local_addr()?;
        self.listener = Some(listener);
        Ok(())
    }

    /// The radar's configuration: to all clients, and to each one that connects.
    pub fn configure(&mut self, message: &[u8]) {
        self.configuration = message.to_vec();
        for client in &mut self.clients {
            client.configured = false;
        }
    }

    /// Accepts clients, reads what is asked, sends what waits.
    pub fn serve(&mut self) {
        while let Some(Ok((stream, _))) = self.listener.as_ref().map(TcpListener::accept) {
            if self.clients.len() < CLIENTS_MAX && stream.set_nonblocking(true).is_ok() {
                // Beams are small and must not wait for each other.
                let _ = stream.set_nodelay(true);
                self.clients.push(Client::new(stream));
            }
        }
        for client in &mut self.clients {
            if !client.configured && !self.configuration.is_empty() {
                client.configured = true;
                client.outgoing.extend_from_slice(&self.configuration);
            }
            client.read(&self.configuration);
            client.write(0);
        }
        self.clients.retain(|client| !client.gone);
    }

    /// To all clients that asked for beams; whether there is one.
    pub fn send(&mut self, message: &[u8]) -> bool {
        let mut taken = false;
        for client in self.clients.iter_mut().filter(|client| client.wants_beams) {
            client.outgoing.extend_from_slice(message);
            client.splits += 1;
            let pieces = SPLITS.get(client.splits % SPLITS.len()).copied();
            client.write(if self.split { pieces.unwrap_or(0) } else { 0 });
            taken = true;
        }
        taken
    }

    pub fn split(&mut self, split: bool) {
        self.split = split;
    }

    /// Ends all connections in the middle of a message.
    pub fn close_in(&mut self, message: &[u8]) {
        let half = message.get(..message.len() / 2).unwrap_or_default();
        for client in &mut self.clients {
            client.outgoing.extend_from_slice(half);
            client.write(0);
            let _ = client.stream.shutdown(Shutdown::Both);
        }
        self.clients.clear();
    }

    /// The radar is gone, or back.
    pub fn unplug(&mut self, gone: bool) {
        if gone {
            self.listener = None;
            self.clients.clear();
        } else if self.listener.is_none() {
            // Tried again with the next beam.
            let _ = self.listen();
        }
    }
}

impl Client {
    fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            parser: FrameParser::default(),
            wants_beams: false,
            configured: false,
            outgoing: Vec::new(),
            splits: 0,
            keep_alive: Instant::now() + KEEP_ALIVE,
            gone: false,
        }
    }

    fn read(&mut self, configuration: &[u8]) {
        let mut piece = [0; 1024];
        match self.stream.read(&mut piece) {
            Ok(0) => self.gone = true,
            Ok(count) => self.parser.push(piece.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.gone = true,
        }
        while let Some(frame) = self.parser.next() {
            match frame.kind {
                kind::START_FFT | kind::START_FFT_WITHOUT_CONTOUR => self.wants_beams = true,
                kind::STOP_FFT => self.wants_beams = false,
                kind::CONFIGURATION_REQUEST => self.outgoing.extend_from_slice(configuration),
                _ => {}
            }
        }
    }

    /// Sends what waits but for the last `kept` bytes.
    fn write(&mut self, kept: usize) {
        let now = Instant::now();
        if now >= self.keep_alive {
            self.keep_alive = now + KEEP_ALIVE;
            command(VERSION, kind::KEEP_ALIVE, &mut self.outgoing);
        }
        let mut end = self.outgoing.len().saturating_sub(kept);
        while end > 0 {
            match self
                .stream
                .write(self.outgoing.get(..end).unwrap_or_default())
            {
                Ok(0) => break,
                Ok(count) => {
                    self.outgoing.drain(..count);
                    end -= count;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => {
                    self.gone = true;
                    break;
                }
            }
        }
        self.gone |= self.outgoing.len() > BEHIND_MAX;
    }
}
