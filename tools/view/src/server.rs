//! The listening socket, and all clients' connections.

use crate::client_log::{ClientLog, Event};
use crate::connection::Connection;
use crate::handshake::{Handshake, Progress};
use crate::limits::{HANDSHAKES_MAX, ViewerLimits, to_evict};
use crate::{AccessPolicy, Board, Refusal};
use std::io::ErrorKind;
use std::net::{TcpListener, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd};
use std::rc::Rc;
use std::time::Duration;

/// An address that cannot be bound is tried again after this time, ns.
const AGAIN_NS: i64 = 1_000_000_000;
/// With viewers something is due with this period.
const PAUSE: Duration = Duration::from_millis(100);
/// A socket that was full is tried again after this time.
const PAUSE_FULL: Duration = Duration::from_millis(20);
/// Without viewers.
const PAUSE_ALONE: Duration = Duration::from_secs(1);
/// Frames that a viewer misses until the status shows it.
const BEHIND: u64 = 1;
/// Clients accepted before it is the viewers' turn, so that a crowd does not keep viewers waiting.
const ACCEPTED_MAX: usize = 2 * HANDSHAKES_MAX;
/// This machine's host name, which may change while it runs.
const OWN_NAME: &str = "/proc/sys/kernel/hostname";

/// All viewers, and clients that may become one.
pub struct Server {
    listen: String,
    session: String,
    policy: Rc<AccessPolicy>,
    limits: ViewerLimits,
    listener: Option<TcpListener>,
    again_ns: i64,
    /// No client is accepted until then, ns; `None` where accepting works.
    rests_until_ns: Option<i64>,
    fault: String,
    /// The oldest first.
    handshakes: Vec<Handshake>,
    viewers: Vec<Connection>,
    log: ClientLog,
}

/// Refuses what can never be an address with a port; a name that does not resolve yet may resolve
/// later.
pub fn check_address(text: &str) -> Result<String, &'static str> {
    match text.to_socket_addrs() {
        Err(cause) if cause.kind() == ErrorKind::InvalidInput => {
            Err("ADDRESS:PORT, such as 127.0.0.1:8765")
        }
        _ => Ok(text.to_owned()),
    }
}

impl Server {
    /// One that will listen at an address. `session` is another one for every process.
    pub fn new(listen: &str, policy: AccessPolicy, limits: ViewerLimits, session: u64) -> Self {
        Self {
            listen: listen.to_owned(),
            session: session.to_string(),
            policy: Rc::new(policy),
            limits,
            listener: None,
            again_ns: i64::MIN,
            rests_until_ns: None,
            fault: String::new(),
            handshakes: Vec::new(),
            viewers: Vec::new(),
            log: ClientLog::default(),
        }
    }

    /// Accepts clients, receives from them, sends viewers what may go. `log_line` gets a line for
    /// the journal.
    pub fn turn(&mut self, board: &Board, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        self.listen(now_ns, log_line);
        self.let_in(now_ns, log_line);
        self.shake_hands(now_ns, log_line);
        let log = &mut self.log;
        self.viewers.retain_mut(|viewer| {
            let turn = viewer.turn(board, now_ns);
            if let Err(why) = &turn {
                let text = format!("{} is gone: {why}", viewer.address);
                log.record(Event::Gone, &text, now_ns, log_line);
            }
            turn.is_ok()
        });
        self.log.catch_up(now_ns, log_line);
    }

    fn listen(&mut self, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        if self.listener.is_some() || now_ns < self.again_ns {
            return;
        }
        self.again_ns = now_ns.saturating_add(AGAIN_NS);
        let made = TcpListener::bind(&self.listen).and_then(|listener| {
            listener.set_nonblocking(true)?;
            Ok((listener.local_addr()?, listener))
        });
        match made {
            Ok((address, listener)) => {
                log_line(&format!("ws://{address}"));
                self.fault.clear();
                self.listener = Some(listener);
            }
            Err(cause) => self.fault = format!("cannot listen on {}: {cause}", self.listen),
        }
    }

    fn let_in(&mut self, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        if self.rests_until_ns.is_some_and(|until| now_ns < until) {
            return;
        }
        self.rests_until_ns = None;
        let mut own_name: Option<Rc<str>> = None;
        for _ in 0..ACCEPTED_MAX {
            let Some(listener) = &self.listener else {
                return;
            };
            let made = listener.accept().and_then(|(stream, address)| {
                let own_name = own_name.get_or_insert_with(read_own_name);
                Handshake::new(stream, address, &self.policy, own_name, now_ns)
            });
            match made {
                Ok(handshake) => self.make_room(handshake, now_ns, log_line),
                Err(cause) if cause.kind() == ErrorKind::WouldBlock => return,
                Err(cause) => {
                    // Such as too many open files: trying again at once would take the whole loop.
                    self.rests_until_ns = Some(now_ns.saturating_add(AGAIN_NS));
                    let text = format!("a client could not come in: {cause}");
                    self.log.record(Event::Accept, &text, now_ns, log_line);
                    return;
                }
            }
        }
    }

    fn make_room(&mut self, newcomer: Handshake, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        if self.handshakes.len() >= HANDSHAKES_MAX {
            // A handshake that can be finished now is not evicted.
            self.shake_hands(now_ns, log_line);
        }
        if self.handshakes.len() >= HANDSHAKES_MAX {
            let waiting: Vec<_> = self.handshakes.iter().map(|h| h.address.ip()).collect();
            if let Some(index) = to_evict(&waiting) {
                let address = self.handshakes.remove(index).address;
                let text = format!("{address} had to make room: too many that are no viewers yet");
                self.log.record(Event::Crowd, &text, now_ns, log_line);
            }
        }
        self.handshakes.push(newcomer);
    }

    fn shake_hands(&mut self, now_ns: i64, log_line: &mut dyn FnMut(&str)) {
        for handshake in std::mem::take(&mut self.handshakes) {
            let address = handshake.address;
            let (event, why) = match handshake.turn(&self.session, now_ns) {
                Progress::Pending(handshake) => {
                    self.handshakes.push(*handshake);
                    continue;
                }
                Progress::Done(connection) => {
                    let watching = self.viewers.iter().map(|viewer| viewer.address.ip());
                    match self.limits.check(address.ip(), watching) {
                        Ok(()) => {
                            let text = format!("{address} watches");
                            self.log.record(Event::Watches, &text, now_ns, log_line);
                            self.viewers.push(*connection);
                            continue;
                        }
                        Err(why) => {
                            connection.turn_away(&why);
                            (Event::Crowd, why)
                        }
                    }
                }
                Progress::Refused(refusal) => (event_of(&refusal), refusal.to_string()),
                Progress::Failed(why) => (Event::Handshake, why),
            };
            let text = format!("{address} is turned away: {why}");
            self.log.record(event, &text, now_ns, log_line);
        }
    }

    /// What is wrong; empty where nothing is.
    pub fn fault(&self) -> &str {
        &self.fault
    }

    /// The number of viewers, and the slowest of them.
    pub fn status_remark(&self, now_ns: i64) -> String {
        let mut text = match self.viewers.len() {
            0 => "no viewer".to_owned(),
            1 => "1 viewer".to_owned(),
            count => format!("{count} viewers"),
        };
        let slowest = self.viewers.iter().max_by_key(|c| c.client.dropped);
        if let Some(slowest) = slowest.filter(|slowest| slowest.client.dropped >= BEHIND) {
            let (address, dropped) = (slowest.address, slowest.client.dropped);
            let link_s = slowest.flow.round_trip_s(now_ns);
            text += &format!("; {address}: {dropped} dropped frames, link {link_s:.1} s");
        }
        let refused = self.log.refused();
        if !refused.is_empty() {
            text.push_str(&format!("; refused: {refused}"));
        }
        text
    }

    /// What to watch for something to read.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        // A client that cannot be accepted now would end every sleep at once.
        let is_open = self.rests_until_ns.is_none();
        let listener = self.listener.iter().filter(move |_| is_open);
        let listener = listener.map(AsFd::as_fd);
        let waiting = self.handshakes.iter().map(Handshake::descriptor);
        let viewers = self.viewers.iter().map(Connection::descriptor);
        listener.chain(waiting).chain(viewers)
    }

    /// How long to sleep at most.
    pub fn pause(&self) -> Duration {
        if self.viewers.is_empty() && self.handshakes.is_empty() {
            PAUSE_ALONE
        } else if self.viewers.iter().any(|viewer| viewer.is_full) {
            PAUSE_FULL
        } else {
            PAUSE
        }
    }
}

fn event_of(refusal: &Refusal) -> Event {
    match refusal {
        Refusal::Origin(_) => Event::Origin,
        Refusal::Host(_) => Event::Host,
        Refusal::Request(_) | Refusal::Protocol(_) => Event::Request,
    }
}

/// This machine's host name; empty, which is no name, where it cannot be read.
fn read_own_name() -> Rc<str> {
    let name = std::fs::read_to_string(OWN_NAME).unwrap_or_default();
    Rc::from(name.trim())
}

#[cfg(test)]
mod tests;
