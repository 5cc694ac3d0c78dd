//! What a stage tells systemd: that it is ready, how it is, that it lives.
//!
//! Our own forty lines instead of a crate: the protocol is one datagram of `KEY=value` lines, and the crates differ from
//! what a stage needs where it matters (an empty NOTIFY_SOCKET is an error to `sd-notify`, and its sends may block).

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;

/// How often a status is told where nothing has changed but its figures, ns.
const STATUS_NS: i64 = 1_000_000_000;

/// The way to who has started this process; silent where that is not systemd.
#[derive(Debug, Default)]
pub(crate) struct Notify {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// The loop says so often that it works; a third of what systemd waits, so that a late one is no death.
    watchdog_ns: Option<i64>,
    next_watchdog_ns: i64,
    next_status_ns: i64,
    was_fresh: bool,
}

impl Notify {
    /// As the environment says.
    pub(crate) fn from_environment() -> Self {
        let variable = |name| std::env::var_os(name).unwrap_or_default();
        let socket = address(&variable("NOTIFY_SOCKET")).and_then(|address| {
            let socket = UnixDatagram::unbound().ok()?;
            // A stage waits for nobody, not even for systemd.
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

    /// Whether anybody listens.
    pub(crate) fn is_heard(&self) -> bool {
        self.to.is_some()
    }

    /// The loop works: tells it when it is time again. Gives when that is, ns.
    pub(crate) fn works(&mut self, now_ns: i64) -> i64 {
        let Some(period_ns) = self.watchdog_ns.filter(|_| self.is_heard()) else {
            return i64::MAX;
        };
        if now_ns >= self.next_watchdog_ns {
            self.send("WATCHDOG=1");
            self.next_watchdog_ns = now_ns + period_ns;
        }
        self.next_watchdog_ns
    }

    /// The ports exist and the loop runs; in words. Said with every status, so that one that was lost is made up for.
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
            // Whoever does not listen has no need to hear it.
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

    fn heard(at: &OsStr, listener: &UnixDatagram, tell: impl FnOnce(&mut Notify)) -> String {
        let mut notify = Notify {
            to: Some((UnixDatagram::unbound().unwrap(), address(at).unwrap())),
            watchdog_ns: Some(10),
            ..Notify::default()
        };
        tell(&mut notify);
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
        assert_eq!(silent.works(0), i64::MAX);
    }

    #[test]
    fn a_path_and_an_abstract_name_are_reached() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let listener = UnixDatagram::bind(&path).unwrap();
        let text = heard(path.as_os_str(), &listener, |notify| notify.stopping());
        assert_eq!(text, "STOPPING=1\nSTATUS=stopping");
        let name = format!("randt-notify-{}", std::process::id());
        let bound = SocketAddr::from_abstract_name(&name).unwrap();
        let listener = UnixDatagram::bind_addr(&bound).unwrap();
        let at = format!("@{name}");
        let text = heard(OsStr::new(&at), &listener, |notify| notify.reloading());
        assert!(text.starts_with("RELOADING=1\nMONOTONIC_USEC="), "{text}");
    }

    #[test]
    fn the_loop_says_that_it_works_at_its_own_pace_and_a_status_when_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let listener = UnixDatagram::bind(&path).unwrap();
        let text = heard(path.as_os_str(), &listener, |notify| {
            assert_eq!(notify.works(100), 110);
            assert_eq!(notify.works(105), 110);
            assert_eq!(notify.works(112), 122);
        });
        assert_eq!(text, "WATCHDOG=1|WATCHDOG=1");
        let text = heard(path.as_os_str(), &listener, |notify| {
            notify.ready(0, "a", true);
            notify.ready(1, "b", true);
            notify.ready(2, "c\nd", false);
            notify.ready(3 + STATUS_NS, "e", false);
        });
        let expected = "READY=1\nSTATUS=a|READY=1\nSTATUS=c d|READY=1\nSTATUS=e";
        assert_eq!(text, expected);
    }
}
