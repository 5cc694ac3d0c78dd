//! Which sender of datagrams is the device.

use randt_config::SenderPin;
use std::net::SocketAddr;

/// Follows who sends.
#[derive(Debug)]
pub(super) struct Senders {
    pin: SenderPin,
    silence_ns: i64,
    /// Who is listened to, and when the last line came from there, ns.
    taken: Option<(SocketAddr, i64)>,
    /// Another one that sent, and when, ns.
    other: Option<(SocketAddr, i64)>,
    /// Datagrams that were left out.
    pub refused: u64,
}

impl Senders {
    pub fn new(pin: SenderPin, silence_ns: i64) -> Self {
        Self {
            pin,
            silence_ns,
            taken: None,
            other: None,
            refused: 0,
        }
    }

    /// Whether a datagram is to be read.
    pub fn allows(&mut self, from: SocketAddr, now_ns: i64) -> bool {
        let is_allowed = self.pin.allows(from)
            && self
                .taken
                .is_none_or(|(taken, at_ns)| taken == from || !self.speaks(at_ns, now_ns));
        if !is_allowed {
            self.refused += 1;
            // Whom the configuration excludes needs no word.
            if self.pin.allows(from) {
                self.other = Some((from, now_ns));
            }
        }
        is_allowed
    }

    /// Whether a sender that is allowed speaks anew: another one than before, or after a silence.
    pub fn begins_anew(&self, from: SocketAddr, now_ns: i64) -> bool {
        self.taken
            .is_some_and(|(taken, at_ns)| taken != from || !self.speaks(at_ns, now_ns))
    }

    /// A line has come from a sender that is allowed.
    pub fn take(&mut self, from: SocketAddr, now_ns: i64) {
        self.taken = Some((from, now_ns));
    }

    fn speaks(&self, at_ns: i64, now_ns: i64) -> bool {
        now_ns.saturating_sub(at_ns) <= self.silence_ns
    }

    /// Two that send at the same time, if they do.
    pub fn two(&self, now_ns: i64) -> Option<[SocketAddr; 2]> {
        let ((taken, _), (other, at_ns)) = self.taken.zip(self.other)?;
        self.speaks(at_ns, now_ns).then_some([taken, other])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENCE_NS: i64 = 500;

    fn address(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    #[test]
    fn the_first_sender_is_listened_to_until_it_is_silent() {
        let (one, two) = (address("10.0.0.5:4000"), address("10.0.0.6:4000"));
        let mut senders = Senders::new(SenderPin::default(), SILENCE_NS);
        // A datagram without a line decides nothing.
        assert!(senders.allows(two, 0) && senders.allows(one, 0));
        assert!(!senders.begins_anew(one, 0));
        senders.take(one, 0);
        assert!(!senders.begins_anew(one, 400));
        senders.take(one, 400);
        assert!(!senders.allows(two, 401) && senders.allows(one, 401));
        assert_eq!(senders.two(402), Some([one, two]));
        assert_eq!((senders.two(2000), senders.refused), (None, 1));
        assert!(senders.allows(two, 2000) && senders.begins_anew(two, 2000));
        senders.take(two, 2000);
        assert!(!senders.allows(one, 2001));
        // The same one after a silence.
        assert!(senders.allows(two, 9000) && senders.begins_anew(two, 9000));
    }

    #[test]
    fn whom_the_configuration_excludes_is_never_listened_to() {
        let pin = SenderPin {
            ip: Some("10.0.0.5".parse().unwrap()),
            port: None,
        };
        let mut senders = Senders::new(pin, SILENCE_NS);
        assert!(!senders.allows(address("10.0.0.6:4000"), 0));
        assert!(senders.allows(address("10.0.0.5:4000"), 0));
        senders.take(address("10.0.0.5:4000"), 0);
        assert!(!senders.allows(address("10.0.0.6:4000"), 9000));
        assert_eq!((senders.refused, senders.two(0)), (2, None));
    }
}
