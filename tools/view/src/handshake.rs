//! The WebSocket handshake of one client, without waiting for its socket.

use crate::access::{AccessPolicy, Refusal};
use crate::connection::{Connection, MESSAGE_MAX, WAITING_MAX};
use crate::protocol;
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::rc::Rc;
use tungstenite::handshake::MidHandshake;
use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::http::HeaderValue;
use tungstenite::http::header::{CONNECTION, CONTENT_TYPE, SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError};

/// A handshake may take this long from connect to answer, ns: ten round trips of a slow link.
const HANDSHAKE_MAX_NS: i64 = 10_000_000_000;

/// One client's handshake.
pub(crate) struct Handshake {
    pub address: SocketAddr,
    /// The same socket, for polling.
    watched: TcpStream,
    begin_ns: i64,
    machine: MidHandshake<ServerHandshake<TcpStream, RequestCheck>>,
}

/// The state of a handshake after a turn.
pub(crate) enum Progress {
    /// More is to come.
    Pending(Box<Handshake>),
    /// It succeeded.
    Done(Box<Connection>),
    /// It was answered with a refusal.
    Refused(Refusal),
    /// It is no WebSocket handshake, or was too slow.
    Failed(String),
}

impl Handshake {
    /// Begins one on an accepted socket. `own_name`: this machine's host name.
    pub fn new(
        stream: TcpStream,
        address: SocketAddr,
        policy: &Rc<AccessPolicy>,
        own_name: &Rc<str>,
        now_ns: i64,
    ) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        // A pose is small, and must not wait for more to come.
        stream.set_nodelay(true)?;
        let watched = stream.try_clone()?;
        let config = WebSocketConfig::default()
            .read_buffer_size(8 << 10)
            .write_buffer_size(0)
            .max_write_buffer_size(WAITING_MAX)
            .max_message_size(Some(MESSAGE_MAX))
            .max_frame_size(Some(MESSAGE_MAX));
        let check = RequestCheck {
            policy: Rc::clone(policy),
            own_name: Rc::clone(own_name),
        };
        Ok(Self {
            address,
            watched,
            begin_ns: now_ns,
            machine: ServerHandshake::start(stream, check, Some(config)),
        })
    }

    /// What to watch for something to read.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.watched.as_fd()
    }

    /// Goes on as far as the socket lets it. `session`: this server's, where it is done.
    pub fn turn(self, session: &str, now_ns: i64) -> Progress {
        if now_ns.saturating_sub(self.begin_ns) > HANDSHAKE_MAX_NS {
            return Progress::Failed("not done in time".to_owned());
        }
        let (address, watched, begin_ns) = (self.address, self.watched, self.begin_ns);
        match self.machine.handshake() {
            Ok(socket) => {
                let connection = Connection::new(socket, watched, address, session);
                Progress::Done(Box::new(connection))
            }
            Err(HandshakeError::Interrupted(machine)) => Progress::Pending(Box::new(Self {
                address,
                watched,
                begin_ns,
                machine,
            })),
            Err(HandshakeError::Failure(Error::Http(answer))) => {
                match answer.extensions().get::<Refusal>() {
                    Some(refusal) => Progress::Refused(refusal.clone()),
                    None => Progress::Failed(answer.status().to_string()),
                }
            }
            Err(HandshakeError::Failure(error)) => Progress::Failed(error.to_string()),
        }
    }
}

/// Checks a request against the policy, and chooses the subprotocol.
struct RequestCheck {
    policy: Rc<AccessPolicy>,
    own_name: Rc<str>,
}

impl Callback for RequestCheck {
    fn on_request(
        self,
        request: &Request,
        mut response: Response,
    ) -> Result<Response, ErrorResponse> {
        let chosen = self.policy.check(request, &self.own_name);
        let chosen = chosen.and_then(|()| choose(request));
        let chosen = chosen.map_err(refuse)?;
        let value = HeaderValue::from_static(chosen);
        response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, value);
        Ok(response)
    }
}

fn choose(request: &Request) -> Result<&'static str, Refusal> {
    let headers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL);
    let offered = headers.iter().filter_map(|value| value.to_str().ok());
    let chosen = offered.filter_map(protocol::choose).next();
    chosen.ok_or_else(|| Refusal::Protocol(protocol::SUBPROTOCOLS.join(", ")))
}

/// The answer to a client that is refused.
fn refuse(refusal: Refusal) -> ErrorResponse {
    let mut answer = ErrorResponse::new(Some(refusal.answer()));
    *answer.status_mut() = refusal.status();
    let headers = answer.headers_mut();
    headers.insert(CONNECTION, HeaderValue::from_static("close"));
    let plain = HeaderValue::from_static("text/plain; charset=utf-8");
    headers.insert(CONTENT_TYPE, plain);
    // The journal needs the client's own text, which the answer does not have.
    answer.extensions_mut().insert(refusal);
    answer
}
