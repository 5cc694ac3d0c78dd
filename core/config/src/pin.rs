//! Keys that pin a sender on the network, or leave it open.

use crate::value::Value;
use serde::{Serialize, Serializer};
use std::fmt;
use std::net::{IpAddr, SocketAddr};
use toml::de::DeValue;

/// The text of a pin that is not set.
const ANY: &str = "any";

/// The device number that datagrams must have; `None`: any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DevicePin(pub Option<u32>);

/// The address that datagrams must come from; without an address any, without a port any port of
/// that address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SenderPin {
    /// The sender's address.
    pub ip: Option<IpAddr>,
    /// Its port.
    pub port: Option<u16>,
}

impl DevicePin {
    /// Whether a device number is the one, or any is.
    pub fn allows(self, device: u32) -> bool {
        self.0.is_none_or(|pinned| pinned == device)
    }
}

impl SenderPin {
    /// Whether an address is the one, or any is.
    pub fn allows(self, from: SocketAddr) -> bool {
        // An IPv6 socket names IPv4 senders by an address of its own.
        self.ip.is_none_or(|ip| ip == from.ip().to_canonical())
            && self.port.is_none_or(|port| port == from.port())
    }

    fn parse(text: &str) -> Option<Self> {
        if text == ANY {
            return Some(Self::default());
        }
        let (ip, port) = match text.parse::<SocketAddr>() {
            Ok(address) => (address.ip(), Some(address.port())),
            Err(_) => (text.parse().ok()?, None),
        };
        // No sender has these addresses.
        let is_nobody = ip.is_unspecified() || ip.is_multicast() || port == Some(0);
        (!is_nobody).then_some(Self {
            ip: Some(ip.to_canonical()),
            port,
        })
    }
}

impl fmt::Display for DevicePin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(device) => write!(f, "{device}"),
            None => f.write_str(ANY),
        }
    }
}

impl fmt::Display for SenderPin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.ip, self.port) {
            (None, _) => f.write_str(ANY),
            (Some(ip), None) => write!(f, "{ip}"),
            (Some(ip), Some(port)) => write!(f, "{}", SocketAddr::new(ip, port)),
        }
    }
}

impl Value for DevicePin {
    const KIND: &'static str = "\"any\" or a whole number from 0 to 4294967295";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        match value.as_str() {
            Some(ANY) => Some(Self(None)),
            Some(_) => None,
            None => u32::read(value).map(|device| Self(Some(device))),
        }
    }

    fn write(&self) -> String {
        match self.0 {
            Some(device) => device.to_string(),
            None => format!("{ANY:?}"),
        }
    }
}

impl Value for SenderPin {
    const KIND: &'static str =
        "\"any\" or the sender's IP, such as \"192.168.0.20\", with or without its port";

    fn read(value: &DeValue<'_>) -> Option<Self> {
        Self::parse(value.as_str()?)
    }

    fn write(&self) -> String {
        format!("\"{self}\"")
    }
}

impl Serialize for DevicePin {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Some(device) => serializer.serialize_u32(device),
            None => serializer.serialize_str(ANY),
        }
    }
}

impl Serialize for SenderPin {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Selection};

    fn load(set: &str) -> Result<Config, String> {
        let selection = Selection {
            set: vec![set.to_owned()],
            ..Selection::default()
        };
        match Config::load(&selection) {
            Ok(loaded) => Ok(loaded.config),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn pins_are_read_written_and_refused() {
        let config = load("radar.device=7").unwrap();
        assert_eq!(config.radar.device, DevicePin(Some(7)));
        assert!(config.radar.device.allows(7) && !config.radar.device.allows(8));
        let config = load("radar.device=\"any\"").unwrap();
        assert!(config.radar.device.allows(8));

        let from = |text: &str| text.parse::<SocketAddr>().unwrap();
        let pin = load("radar.sender=192.168.0.20").unwrap().radar.sender;
        assert!(pin.allows(from("192.168.0.20:1")) && !pin.allows(from("192.168.0.21:1")));
        assert!(pin.allows(from("[::ffff:192.168.0.20]:1")));
        let pin = load("radar.sender=192.168.0.20:5000").unwrap().radar.sender;
        assert!(pin.allows(from("192.168.0.20:5000")) && !pin.allows(from("192.168.0.20:5001")));
        assert_eq!(pin.write(), "\"192.168.0.20:5000\"");

        for wrong in [
            "radar.device=-1",
            "radar.device=4294967296",
            "radar.device=1.5",
            "radar.sender=0.0.0.0",
            "radar.sender=239.255.0.1",
            "radar.sender=192.168.0.20:0",
            "radar.sender=192.168.0.20:65536",
            "radar.sender=radar.local",
            "radar.sender=\"\"",
        ] {
            let refusal = load(wrong).unwrap_err();
            assert!(refusal.contains("any"), "{wrong}: {refusal}");
        }
    }
}
