//! A viewer's connection: a socket that is never waited for.

use crate::{Board, Client, Flow, Frame, protocol};
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use tungstenite::handshake::MidHandshake;
use tungstenite::handshake::server::{ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, WebSocket};

/// A viewer who takes or answers nothing for so long is gone, s.
const SILENT_MAX_S: f64 = 10.0;
/// A viewer's messages are subscriptions, bytes.
const HEARD_MAX: usize = 64 << 10;
/// What waits here for the socket: it holds what may be under way, and a message. Beyond that the viewer is gone.
const WAITING_MAX: usize = 16 << 20;
/// Messages that are heard or sent before it is another's turn.
const TURN: usize = 64;

type Chooser = fn(&Request, Response) -> Result<Response, ErrorResponse>;
type Handshake = ServerHandshake<TcpStream, Chooser>;

enum Phase {
    Greeting(Option<Box<MidHandshake<Handshake>>>),
    Open(Box<WebSocket<TcpStream>>),
}

/// One viewer's connection.
pub(crate) struct Connection {
    pub address: SocketAddr,
    /// The same socket, to be watched.
    watched: TcpStream,
    phase: Phase,
    pub client: Client,
    pub flow: Flow,
    begin_ns: i64,
    /// Whether the system takes nothing more for now.
    pub is_full: bool,
}

impl Connection {
    /// One who has knocked.
    pub fn new(
        stream: TcpStream,
        address: SocketAddr,
        session: &str,
        now_ns: i64,
    ) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        // A pose is small, and shall not wait for more to come.
        stream.set_nodelay(true)?;
        let watched = stream.try_clone()?;
        let config = WebSocketConfig::default()
            .read_buffer_size(8 << 10)
            .write_buffer_size(0)
            .max_write_buffer_size(WAITING_MAX)
            .max_message_size(Some(HEARD_MAX))
            .max_frame_size(Some(HEARD_MAX));
        let chooser: Chooser = choose;
        let handshake = Handshake::start(stream, chooser, Some(config));
        Ok(Self {
            address,
            watched,
            phase: Phase::Greeting(Some(Box::new(handshake))),
            client: Client::new(session),
            flow: Flow::default(),
            begin_ns: now_ns,
            is_full: false,
        })
    }

    /// What to watch for something to read.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.watched.as_fd()
    }

    /// Hears what has come, sends what may go; gives why the viewer is gone, where it is.
    pub fn turn(&mut self, board: &Board, now_ns: i64) -> Result<(), String> {
        if let Phase::Greeting(mid) = &mut self.phase {
            if now_ns - self.begin_ns > (SILENT_MAX_S * 1e9) as i64 {
                return Err("said nothing".to_owned());
            }
            let Some(handshake) = mid.take() else {
                return Err("left".to_owned());
            };
            match handshake.handshake() {
                Ok(socket) => self.phase = Phase::Open(Box::new(socket)),
                Err(HandshakeError::Interrupted(later)) => {
                    *mid = Some(Box::new(later));
                    return Ok(());
                }
                Err(HandshakeError::Failure(error)) => return Err(error.to_string()),
            }
        }
        self.hear(now_ns)?;
        self.send(board, now_ns)?;
        let silent_s = self.flow.silent_s(now_ns);
        if silent_s > SILENT_MAX_S {
            return Err(format!("has taken nothing for {silent_s:.0} s"));
        }
        Ok(())
    }

    fn hear(&mut self, now_ns: i64) -> Result<(), String> {
        let Phase::Open(socket) = &mut self.phase else {
            return Ok(());
        };
        for _ in 0..TURN {
            match socket.read() {
                Ok(Message::Text(text)) => self.client.hear(&text),
                Ok(Message::Pong(content)) => self.flow.pong(&content, now_ns),
                Ok(_) => {}
                Err(error) if would_block(&error) => return Ok(()),
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(())
    }

    fn send(&mut self, board: &Board, now_ns: i64) -> Result<(), String> {
        let Phase::Open(socket) = &mut self.phase else {
            return Ok(());
        };
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

/// Agrees on the protocol, or turns the viewer away with a reason.
#[expect(
    clippy::result_large_err,
    reason = "the answer's type is the library's"
)]
fn choose(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let headers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL);
    let offered = headers.iter().filter_map(|value| value.to_str().ok());
    if let Some(chosen) = offered.filter_map(protocol::choose).next() {
        let value = HeaderValue::from_static(chosen);
        response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, value);
        return Ok(response);
    }
    let reason = format!("speak one of {}", protocol::SUBPROTOCOLS.join(", "));
    let mut refusal = ErrorResponse::new(Some(reason));
    *refusal.status_mut() = StatusCode::BAD_REQUEST;
    Err(refusal)
}
