//! What a stage sends to systemd: that it is ready, its status, the watchdog's signal.
//!
//! Our own forty lines instead of a crate: the protocol is one datagram of `KEY=value` lines, and
//! the crates differ from what a stage needs where it matters (an empty NOTIFY_SOCKET is an error
//! to `sd-notify`, and its sends may block).

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;

/// How often a status is sent if only its figures have changed, ns.
const STATUS_NS: i64 = 1_000_000_000;

/// The connection to systemd; does nothing if another program has started this process.
#[derive(Debug, Default)]
pub(crate) struct Notify {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// How often the loop feeds the watchdog: a third of what systemd waits, so that a late signal
    /// does not kill the stage.
    watchdog_ns: Option<i64>,
    next_watchdog_ns: i64,
    next_status_ns: i64,
    was_fresh: bool,
}

impl Notify {
    /// As the environment variables of systemd say.
    pub(crate) fn from_environment() -> Self {
        let variable = |name| std::env::var_os(name).unwrap_or_default();
        let socket = address(&variable("NOTIFY_SOCKET")).and_then(|address| {
            let socket = UnixDatagram::unbound().ok()?;
            // A stage never waits for systemd.
            socket.set_nonblocking(true).ok()?;
            Some((socket, address))
        });
        let number = |name| variable(name).to_str()?.parse::<u64>().ok();
        let own = u64::from(std::process::id());
        let is_ours = number("WATCHDOG_PID").is_none_or(|pid| pid == own);
        let period = number("WATCHDOG_USEC").filter(|period| is_ours && *period > 0);
        let third = period.map(|microseconds| Duration::from_micros(microseconds) / 3);
        Self {
            to: socket,
            watchdog_ns: third.and_then(|third| i64::try_from(third.as_nanos()).ok()),
            ..Self::default()
        }
    }

    /// Whether systemd listens.
    pub(crate) fn has_listener(&self) -> bool {
        self.to.is_some()
    }

    /// Feeds the watchdog when that is due; returns when it is due next, ns.
    pub(crate) fn feed_watchdog(&mut self, now_ns: i64) -> i64 {
        let Some(period_ns) = self.watchdog_ns.filter(|_| self.has_listener()) else {
            return i64::MAX;
        };
        if now_ns >= self.next_watchdog_ns {
            self.send("WATCHDOG=1");
            self.next_watchdog_ns = now_ns + period_ns;
        }
        self.next_watchdog_ns
    }

    /// The ports exist and the loop runs. Sent with every status, so that a lost one is made up
    /// for.
    pub(crate) fn ready(&mut self, now_ns: i64, status: &str, is_fresh: bool) {
        if now_ns < self.next_status_ns && is_fresh == self.was_fresh {
            return;
        }
        (self.next_status_ns, self.was_fresh) = (now_ns + STATUS_NS, is_fresh);
        self.send(&format!("READY=1\nSTATUS={}", status.replace('\n', " ")));
    }

    /// The configuration is read again, until the stage is ready the next time.
    pub(crate) fn reloading(&mut self) {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        let microseconds = now.tv_sec * 1_000_000 + now.tv_nsec / 1000;
        self.send(&format!("RELOADING=1\nMONOTONIC_USEC={microseconds}"));
        self.next_status_ns = 0;
    }

    /// The end has begun.
    pub(crate) fn stopping(&mut self) {
        self.send("STOPPING=1\nSTATUS=stopping");
    }

    fn send(&self, text: &str) {
        if let Some((socket, address)) = &self.to {
            // A supervisor that does not listen does not need it.
            let _ = socket.send_to_addr(text.as_bytes(), address);
        }
    }
}

/// The address of a socket's path; one that begins with @ is abstract. An empty one is none.
fn address(path: &OsStr) -> Option<SocketAddr> {
    match path.as_bytes() {
        [] => None,
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name).ok(),
        _ => SocketAddr::from_pathname(path).ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(at: &OsStr, listener: &UnixDatagram, send: impl FnOnce(&mut Notify)) -> String {
        let mut notify = Notify {
            to: Some((UnixDatagram::unbound().unwrap(), address(at).unwrap())),
            watchdog_ns: Some(10),
            ..Notify::default()
        };
        send(&mut notify);
        listener.set_nonblocking(true).unwrap();
        let mut texts = Vec::new();
        let mut bytes = [0; 256];
        while let Ok(length) = listener.recv(&mut bytes) {
            texts.push(String::from_utf8(bytes[..length].to_vec()).unwrap());
        }
        texts.join("|")
    }

    #[test]
    fn an_empty_socket_is_none() {
        assert!(address(OsStr::new("")).is_none());
        let mut silent = Notify::default();
        silent.ready(0, "all is well", true);
        assert_eq!(silent.feed_watchdog(0), i64::MAX);
    }

    #[test]
    fn a_path_and_an_abstract_name_are_reached() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let listener = UnixDatagram::bind(&path).unwrap();
        let text = received(path.as_os_str(), &listener, |notify| notify.stopping());
        assert_eq!(text, "STOPPING=1\nSTATUS=stopping");
        let name = format!("randt-notify-{}", std::process::id());
        let bound = SocketAddr::from_abstract_name(&name).unwrap();
        let listener = UnixDatagram::bind_addr(&bound).unwrap();
        let at = format!("@{name}");
        let text = received(OsStr::new(&at), &listener, |notify| notify.reloading());
        assert!(text.starts_with("RELOADING=1\nMONOTONIC_USEC="), "{text}");
    }

    #[test]
    fn the_watchdog_is_fed_at_its_own_pace_and_a_status_is_sent_when_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let listener = UnixDatagram::bind(&path).unwrap();
        let text = received(path.as_os_str(), &listener, |notify| {
            assert_eq!(notify.feed_watchdog(100), 110);
            assert_eq!(notify.feed_watchdog(105), 110);
            assert_eq!(notify.feed_watchdog(112), 122);
        });
        assert_eq!(text, "WATCHDOG=1|WATCHDOG=1");
        let text = received(path.as_os_str(), &listener, |notify| {
            notify.ready(0, "a", true);
            notify.ready(1, "b", true);
            notify.ready(2, "c\nd", false);
            notify.ready(3 + STATUS_NS, "e", false);
        });
        let expected = "READY=1\nSTATUS=a|READY=1\nSTATUS=c d|READY=1\nSTATUS=e";
        assert_eq!(text, expected);
    }
}
