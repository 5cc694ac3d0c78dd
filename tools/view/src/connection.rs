//! A viewer's connection: a socket that is never waited for.

use crate::{Board, Client, Flow, Frame};
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use tungstenite::protocol::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Error, Message, WebSocket};

/// A viewer that takes or answers nothing for this time is gone, s.
const SILENT_MAX_S: f64 = 10.0;
/// A viewer's messages are subscriptions, bytes.
pub(crate) const MESSAGE_MAX: usize = 64 << 10;
/// What waits here for the socket: it holds what may be under way, and a message. Beyond that the
/// viewer is gone.
pub(crate) const WAITING_MAX: usize = 16 << 20;
/// Messages that are received or sent before it is another's turn.
const TURN: usize = 64;

/// One viewer's connection.
pub(crate) struct Connection {
    pub address: SocketAddr,
    /// The same socket, to be watched.
    watched: TcpStream,
    socket: WebSocket<TcpStream>,
    pub client: Client,
    pub flow: Flow,
    /// Whether the system takes nothing more for now.
    pub is_full: bool,
}

impl Connection {
    /// One whose handshake is done.
    pub fn new(
        socket: WebSocket<TcpStream>,
        watched: TcpStream,
        address: SocketAddr,
        session: &str,
    ) -> Self {
        Self {
            address,
            watched,
            socket,
            client: Client::new(session),
            flow: Flow::default(),
            is_full: false,
        }
    }

    /// What to watch for something to read.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.watched.as_fd()
    }

    /// Ends it before anything was sent, with a reason that browsers show.
    pub fn turn_away(mut self, reason: &str) {
        let frame = CloseFrame {
            code: CloseCode::Again,
            reason: reason.into(),
        };
        // A client that does not take it sees the end of the connection.
        let _ = self.socket.close(Some(frame));
        let _ = self.socket.flush();
    }

    /// Receives what has come, sends what may go; gives why the viewer is gone, where it is.
    pub fn turn(&mut self, board: &Board, now_ns: i64) -> Result<(), String> {
        self.receive(now_ns)?;
        self.send(board, now_ns)?;
        let silent_s = self.flow.silent_s(now_ns);
        if silent_s > SILENT_MAX_S {
            return Err(format!("has taken nothing for {silent_s:.0} s"));
        }
        Ok(())
    }

    fn receive(&mut self, now_ns: i64) -> Result<(), String> {
        let socket = &mut self.socket;
        for _ in 0..TURN {
            match socket.read() {
                Ok(Message::Text(text)) => self.client.receive(&text),
                Ok(Message::Pong(content)) => self.flow.pong(&content, now_ns),
                Ok(_) => {}
                Err(error) if would_block(&error) => return Ok(()),
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(())
    }

    fn send(&mut self, board: &Board, now_ns: i64) -> Result<(), String> {
        let socket = &mut self.socket;
        for _ in 0..TURN {
            // What the system did not take before goes first.
            self.is_full = !done(socket.flush())?;
            if self.is_full {
                return Ok(());
            }
            let Some(frame) = self.client.next(board, &self.flow, now_ns) else {
                break;
            };
            self.flow.wrote(frame.size());
            let message = match frame {
                Frame::Text(text) => Message::text(text),
                Frame::Binary(bytes) => Message::binary(bytes),
            };
            done(socket.write(message))?;
            if let Some(content) = self.flow.ping(now_ns, false) {
                done(socket.write(Message::Ping(content.to_vec().into())))?;
            }
        }
        if let Some(content) = self.flow.ping(now_ns, true) {
            done(socket.write(Message::Ping(content.to_vec().into())))?;
        }
        Ok(())
    }
}

/// Whether all went out; what could not is kept by the socket's owner and goes out later.
fn done(result: Result<(), Error>) -> Result<bool, String> {
    match result {
        Ok(()) => Ok(true),
        Err(error) if would_block(&error) => Ok(false),
        Err(error) => Err(error.to_string()),
    }
}

fn would_block(error: &Error) -> bool {
    matches!(error, Error::Io(cause) if cause.kind() == ErrorKind::WouldBlock)
}
