//! Where a web page comes from, as its browser names it in the Origin header (RFC 6454).

use crate::Host;
use std::fmt;

/// Origins of local files have no host.
const FILE: &str = "file";

/// Scheme, host and port of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebOrigin {
    /// In lower case.
    scheme: String,
    /// `None` for a local file.
    host: Option<Host>,
    /// `None` where it is the scheme's own.
    port: Option<u16>,
}

impl WebOrigin {
    /// Reads SCHEME://HOST or SCHEME://HOST:PORT, such as `https://viewer.example:8443`, or
    /// `file://`. `None` for what is no origin, such as `null`: any page can have that one, by a
    /// sandboxed frame.
    pub fn parse(text: &str) -> Option<Self> {
        let (scheme, rest) = text.split_once("://")?;
        let is_part = |byte: u8| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte);
        let is_scheme = scheme.starts_with(|first: char| first.is_ascii_alphabetic())
            && scheme.bytes().all(is_part);
        let scheme = Some(scheme.to_ascii_lowercase()).filter(|_| is_scheme)?;
        let (host, port) = match (scheme.as_str(), rest) {
            (FILE, "") => (None, None),
            (FILE, _) => return None,
            _ => Host::parse_with_port(rest).map(|(host, port)| (Some(host), port))?,
        };
        let port = port.filter(|port| default_port(&scheme) != Some(*port));
        Some(Self { scheme, host, port })
    }

    /// Whether a server on the machine of the browser itself sent the page, from any port.
    pub fn is_on_loopback(&self) -> bool {
        self.is_web() && self.host.as_ref().is_some_and(Host::is_loopback)
    }

    /// Whether a server at the same literal address sent the page, from any port. By a name this
    /// would prove nothing: DNS rebinding makes both the same.
    pub fn is_at_address_of(&self, host: &Host) -> bool {
        self.is_web() && matches!(host, Host::Address(_)) && self.host.as_ref() == Some(host)
    }

    fn is_web(&self) -> bool {
        default_port(&self.scheme).is_some()
    }
}

fn default_port(scheme: &str) -> Option<u16> {
    match scheme {
        "http" => Some(80),
        "https" => Some(443),
        _ => None,
    }
}

impl fmt::Display for WebOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}://", self.scheme)?;
        if let Some(host) = &self.host {
            write!(f, "{host}")?;
        }
        match self.port {
            Some(port) => write!(f, ":{port}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(text: &str) -> WebOrigin {
        WebOrigin::parse(text).unwrap()
    }

    #[test]
    fn origins_are_compared_by_scheme_host_and_port() {
        assert_eq!(origin("https://a.example:443"), origin("HTTPS://A.example"));
        assert_eq!(origin("http://[::1]:80"), origin("http://[0::1]"));
        assert_ne!(origin("https://a.example:80"), origin("https://a.example"));
        assert_ne!(origin("http://a.example"), origin("https://a.example"));
        for text in [
            "file://",
            "http://[::1]:81",
            "vscode-webview://0a1b",
            "app://-",
        ] {
            assert_eq!(origin(text).to_string(), text);
        }
    }

    #[test]
    fn what_could_be_anybodys_is_no_origin() {
        for text in [
            "",
            "null",
            "*",
            "http",
            "://a",
            "http://",
            "http:///",
            "file:///",
            "file://a",
            "http://*",
            "https://*.example",
            "http://a/",
            "http://a/b",
            "http://a?b",
            "http://a#b",
            "http://u@a",
            "http://u:p@a",
            "http://a http://b",
            "http://a, http://b",
            "http://a:b",
            "http://a.",
            "1http://a",
            "ht tp://a",
            "https://app.foxglove.dev\\@evil.example",
        ] {
            assert_eq!(WebOrigin::parse(text), None, "{text:?}");
        }
    }

    #[test]
    fn a_page_at_an_address_differs_from_one_that_only_claims_so() {
        let literal = Host::parse("10.0.0.5").unwrap();
        assert!(origin("http://10.0.0.5:8080").is_at_address_of(&literal));
        assert!(!origin("http://10.0.0.6:8080").is_at_address_of(&literal));
        assert!(!origin("app://10.0.0.5").is_at_address_of(&literal));
        let name = Host::parse("evil.example").unwrap();
        assert!(!origin("http://evil.example").is_at_address_of(&name));
        for text in [
            "http://localhost:8080",
            "https://127.0.0.1",
            "http://[::1]:1",
        ] {
            assert!(origin(text).is_on_loopback(), "{text}");
        }
        for text in [
            "http://localhost.evil.example",
            "file://",
            "app://localhost",
            "http://a",
        ] {
            assert!(!origin(text).is_on_loopback(), "{text}");
        }
    }
}
