//! A sender of beams.

use std::fmt;
use std::net::SocketAddr;

/// A sender of beams, as its datagrams name it: every host can write both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sender {
    /// Device number in its datagrams; 0 where the protocol has none.
    pub device: u32,
    /// Where its datagrams come from; `None` where there is a connection.
    pub address: Option<SocketAddr>,
}

impl Sender {
    /// In what two senders differ, and the key that decides between them: short, because a stage's
    /// message is.
    pub fn difference(&self, other: &Self) -> String {
        let ip = |sender: &Self| sender.address.map(|address| address.ip());
        let port = |sender: &Self| sender.address.map_or(0, |address| address.port());
        match (ip(self), ip(other)) {
            (Some(one), Some(two)) if one != two => {
                format!("{one} and {two}: set radar.sender")
            }
            _ if self.device != other.device => {
                let (one, two) = (self.device, other.device);
                format!("devices {one} and {two}: set radar.device")
            }
            (Some(ip), _) if port(self) != port(other) => {
                let (one, two) = (port(self), port(other));
                format!("{ip}, ports {one} and {two}: set radar.sender")
            }
            _ => "both by one address and number: docs/beam-udp.md, Security".to_owned(),
        }
    }
}

impl fmt::Display for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "device {}", self.device)?;
        match self.address {
            Some(address) => write!(f, " at {address}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender(device: u32, address: &str) -> Sender {
        Sender {
            device,
            address: Some(address.parse().unwrap()),
        }
    }

    #[test]
    fn two_senders_are_distinguished_by_what_differs() {
        let ours = sender(7, "10.0.0.5:4000");
        for (other, words) in [
            (sender(9, "10.0.0.6:4000"), "10.0.0.5 and 10.0.0.6"),
            (sender(9, "10.0.0.5:4001"), "devices 7 and 9"),
            (sender(7, "10.0.0.5:4001"), "ports 4000 and 4001"),
            (ours, "one address"),
        ] {
            let text = ours.difference(&other);
            assert!(text.contains(words), "{text}");
        }
    }
}
