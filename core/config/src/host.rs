//! The host of a URL: which machine a client means, or where a page comes from.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// DNS allows no longer name, and no longer label in one.
const NAME_MAX: usize = 253;
const LABEL_MAX: usize = 63;
/// The name that browsers never resolve: it is always the machine that they run on.
const LOCALHOST: &str = "localhost";

/// A host as a URL or a Host header names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Host {
    /// A literal address. No web page can change where it leads.
    Address(IpAddr),
    /// A name, in lower case. Its owner decides where it leads, and may change that.
    Name(String),
}

impl Host {
    /// Reads a host alone; an IPv6 address is in brackets. `None` for anything that no browser
    /// writes: user information, a trailing dot, an IPv6 zone, an IPv4 address in another
    /// notation.
    pub fn parse(text: &str) -> Option<Self> {
        if let Some(inside) = text.strip_prefix('[') {
            let address: Ipv6Addr = inside.strip_suffix(']')?.parse().ok()?;
            return Some(Self::Address(IpAddr::V6(address).to_canonical()));
        }
        if let Ok(address) = text.parse::<Ipv4Addr>() {
            return Some(Self::Address(IpAddr::V4(address)));
        }
        let is_name = text.len() <= NAME_MAX
            && text.split('.').all(is_label)
            && !text.rsplit('.').next().is_some_and(is_number);
        is_name.then(|| Self::Name(text.to_ascii_lowercase()))
    }

    /// Reads `HOST` or `HOST:PORT`.
    pub fn parse_with_port(text: &str) -> Option<(Self, Option<u16>)> {
        // The colons of an IPv6 address stand before its bracket.
        let port_begin = match text.rfind(':') {
            Some(colon) if !text.ends_with(']') => colon,
            _ => return Some((Self::parse(text)?, None)),
        };
        let (host, port) = (text.get(..port_begin)?, text.get(port_begin + 1..)?);
        // A sign is no part of a port, but Rust's parser takes one.
        let is_port = port.bytes().all(|byte| byte.is_ascii_digit());
        let port = port.parse().ok().filter(|_| is_port)?;
        Some((Self::parse(host)?, Some(port)))
    }

    /// Whether it is the machine that the client runs on, wherever that is.
    pub fn is_loopback(&self) -> bool {
        match self {
            Self::Address(address) => address.is_loopback(),
            Self::Name(name) => name == LOCALHOST,
        }
    }

    /// Whether it is a name of the machine that calls itself `own_name`: that name, its first
    /// part, and both as multicast DNS knows them.
    pub fn is_own(&self, own_name: &str) -> bool {
        let Self::Name(name) = self else {
            return false;
        };
        let name = name.strip_suffix(".local").unwrap_or(name);
        let own_name = own_name.to_ascii_lowercase();
        let full = own_name.strip_suffix(".local").unwrap_or(&own_name);
        let first = full.split('.').next().unwrap_or_default();
        !name.is_empty() && (name == full || name == first)
    }
}

fn is_label(label: &str) -> bool {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    (1..=LABEL_MAX).contains(&label.len()) && label.bytes().all(is_part)
}

/// Whether browsers take a name with this last label for an IPv4 address.
fn is_number(label: &str) -> bool {
    let lower = label.to_ascii_lowercase();
    match lower.strip_prefix("0x") {
        Some(digits) => digits.bytes().all(|byte| byte.is_ascii_hexdigit()),
        None => lower.bytes().all(|byte| byte.is_ascii_digit()),
    }
}

impl fmt::Display for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(IpAddr::V6(address)) => write!(f, "[{address}]"),
            Self::Address(IpAddr::V4(address)) => write!(f, "{address}"),
            Self::Name(name) => write!(f, "{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn address(text: &str) -> Option<Host> {
        Some(Host::Address(text.parse().unwrap()))
    }

    #[test]
    fn a_host_is_an_address_or_a_name() {
        assert_eq!(Host::parse("127.0.0.1"), address("127.0.0.1"));
        assert_eq!(Host::parse("[::1]"), address("::1"));
        assert_eq!(Host::parse("[0:0::0:1]"), address("::1"));
        assert_eq!(Host::parse("[::ffff:127.0.0.1]"), address("127.0.0.1"));
        for name in [
            "robot",
            "ROBOT.local",
            "a-b_c.example.com",
            "xn--rbt-hoa.de",
        ] {
            let expected = Host::Name(name.to_ascii_lowercase());
            assert_eq!(Host::parse(name), Some(expected));
        }
    }

    #[test]
    fn what_no_browser_writes_is_no_host() {
        let long = format!("{}.de", "x".repeat(64));
        let longer = "x.".repeat(126) + "de";
        for text in [
            "",
            ".",
            "localhost.",
            ".localhost",
            "a..b",
            "user@localhost",
            "local host",
            "localhost/",
            "localhost\\",
            "localhost#",
            "localhost?",
            "lo\u{441}alhost",
            "*",
            "::1",
            "[::1",
            "::1]",
            "[]",
            "[fe80::1%25eth0]",
            "[127.0.0.1]",
            "[::1]x",
            "127.1",
            "0x7f000001",
            "0x7f.1",
            "2130706433",
            "127.0.0.01",
            "127.0.0.1.",
            "1.2.3.4.5",
            "evil.example%00.localhost",
            &long,
            &longer,
        ] {
            assert_eq!(Host::parse(text), None, "{text:?}");
        }
    }

    #[test]
    fn a_port_is_a_number_of_16_bits() {
        let localhost = Host::Name("localhost".to_owned());
        for (text, port) in [("localhost", None), ("localhost:8765", Some(8765))] {
            assert_eq!(Host::parse_with_port(text), Some((localhost.clone(), port)));
        }
        let (host, port) = Host::parse_with_port("[::1]:8765").unwrap();
        assert_eq!((host.to_string().as_str(), port), ("[::1]", Some(8765)));
        assert_eq!(Host::parse_with_port("[::1]").unwrap().1, None);
        for text in [
            "localhost:",
            "localhost:x",
            "localhost:+80",
            "localhost:-1",
            "localhost:65536",
            "localhost:80:80",
            "localhost:80@evil.example",
            "evil@localhost:80",
            ":80",
            "::1:80",
            "localhost: 80",
            "localhost:80 ",
        ] {
            assert_eq!(Host::parse_with_port(text), None, "{text:?}");
        }
    }

    #[test]
    fn a_machine_has_its_name_and_that_of_multicast_dns() {
        let own = |name: &str, own_name: &str| Host::parse(name).unwrap().is_own(own_name);
        for name in ["robot", "Robot.local", "robot.lan", "robot.lan.local"] {
            assert!(own(name, "robot.lan"), "{name}");
        }
        assert!(own("robot.local", "robot") && own("robot", "ROBOT.local"));
        for name in [
            "lan",
            "robot.lan.evil.example",
            "robot.evil.example",
            "xrobot",
            "local",
        ] {
            assert!(!own(name, "robot.lan"), "{name}");
        }
        for unnamed in ["", "(none)", ".", ".local"] {
            assert!(
                !own("local", unnamed) && !own("x.local", unnamed),
                "{unnamed}"
            );
        }
        assert!(Host::parse("LOCALHOST").unwrap().is_loopback());
        assert!(Host::parse("[::ffff:127.3.2.1]").unwrap().is_loopback());
        assert!(!Host::parse("localhost.evil.example").unwrap().is_loopback());
        assert!(!Host::parse("0.0.0.0").unwrap().is_loopback());
    }

    proptest! {
        #[test]
        fn what_is_read_is_read_again_from_what_is_shown(text in "[a-zA-Z0-9.:@\\[\\]%_-]{0,30}") {
            if let Some((host, _)) = Host::parse_with_port(&text) {
                prop_assert_eq!(Host::parse(&host.to_string()), Some(host));
            }
        }
    }
}
