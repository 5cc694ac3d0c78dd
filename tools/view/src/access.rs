//! Access control by the handshake's headers. A browser names the page that connects (Origin) and
//! the machine that the page asked for (Host), and no page can change either. Programs that are no
//! browser send what they like: this keeps foreign pages away, and nothing else.

use randt_config::{Host, HostNames, WebOrigin, WebOrigins};
use tungstenite::handshake::server::Request;
use tungstenite::http::StatusCode;
use tungstenite::http::header::{HOST, HeaderName, ORIGIN};

/// Origins of the viewers' own programs: Lichtblick's desktop program, Foxglove and Lichtblick in
/// a browser. Electron gives `file://` to the desktop program's pages; in a browser a local file
/// has `null`, as has a sandboxed frame of any page. https://embed.foxglove.dev is not among them:
/// any page can embed it and load its own extensions into it.
const VIEWERS: [&str; 3] = [
    "file://",
    "https://app.foxglove.dev",
    "https://lichtblick-suite.github.io",
];
/// This many characters of a client's header are enough for the journal.
const SHOWN_MAX: usize = 80;

/// Which pages may watch, and which names this machine has.
#[derive(Clone, Debug)]
pub struct AccessPolicy {
    origins: Vec<WebOrigin>,
    host_names: Vec<Host>,
}

/// Why a client may not watch.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The request is not one that a browser or a viewer sends.
    #[error("a request with {0}")]
    Request(&'static str),
    /// Its Host header is not a name of this machine: DNS rebinding, or a name that is not
    /// configured.
    #[error("host {0:?} is none of this machine's names")]
    Host(String),
    /// Its Origin header is that of a foreign page.
    #[error("a page of origin {0:?} may not watch")]
    Origin(String),
    /// It speaks no protocol that we speak.
    #[error("it speaks none of {0}")]
    Protocol(String),
}

impl Refusal {
    /// The status that answers it.
    pub fn status(&self) -> StatusCode {
        match self {
            Self::Request(_) | Self::Protocol(_) => StatusCode::BAD_REQUEST,
            Self::Host(_) | Self::Origin(_) => StatusCode::FORBIDDEN,
        }
    }

    /// The answer's body: the reason and the key that would allow it, without the client's own
    /// text.
    pub fn answer(&self) -> String {
        match self {
            Self::Request(what) => format!("A request with {what} is not understood.\n"),
            Self::Host(_) => "This host name is not this machine's. \
                              Use its address, or add the name to view.host_names.\n"
                .to_owned(),
            Self::Origin(_) => "Pages of this origin may not watch. \
                                If it is yours, add it to view.origins.\n"
                .to_owned(),
            Self::Protocol(ours) => format!("Speak one of {ours}.\n"),
        }
    }
}

impl AccessPolicy {
    /// The viewers' own programs, and what the configuration adds.
    pub fn new(origins: &WebOrigins, host_names: &HostNames) -> Self {
        let viewers = VIEWERS.iter().filter_map(|origin| WebOrigin::parse(origin));
        Self {
            origins: viewers.chain(origins.0.iter().cloned()).collect(),
            host_names: host_names.0.clone(),
        }
    }

    /// Judges a client by its request. `own_name`: what this machine calls itself.
    pub fn check(&self, request: &Request, own_name: &str) -> Result<(), Refusal> {
        let target = request.uri();
        // An absolute target would stand for the Host header.
        if target.authority().is_some() || !target.path().starts_with('/') {
            return Err(Refusal::Request("a target that is no path"));
        }
        let named = only(request, HOST, "two Host headers")?;
        let named = named.ok_or(Refusal::Request("no Host header"))?;
        let host = Host::parse_with_port(named).map(|(host, _)| host);
        let host = host.filter(|host| self.is_this_machine(host, own_name));
        let host = host.ok_or_else(|| Refusal::Host(shown(named)))?;
        match only(request, ORIGIN, "two Origin headers")? {
            // No page of a browser comes without.
            None => Ok(()),
            Some(origin) if self.may_watch(origin, &host) => Ok(()),
            Some(origin) => Err(Refusal::Origin(shown(origin))),
        }
    }

    /// Any port is accepted, because a tunnel has another one than we listen on. Any literal
    /// address is, because behind a tunnel or a router it is not ours, and DNS cannot redirect it.
    fn is_this_machine(&self, host: &Host, own_name: &str) -> bool {
        matches!(host, Host::Address(_))
            || host.is_loopback()
            || host.is_own(own_name)
            || self.host_names.contains(host)
    }

    fn may_watch(&self, origin: &str, host: &Host) -> bool {
        WebOrigin::parse(origin).is_some_and(|origin| {
            self.origins.contains(&origin)
                || origin.is_on_loopback()
                || origin.is_at_address_of(host)
        })
    }
}

/// The value of a header that must be unique: parsers disagree on which of two values counts.
fn only<'a>(
    request: &'a Request,
    name: HeaderName,
    twice: &'static str,
) -> Result<Option<&'a str>, Refusal> {
    let mut values = request.headers().get_all(name).iter();
    let first = values.next();
    if values.next().is_some() {
        return Err(Refusal::Request(twice));
    }
    let text = first.map(|value| value.to_str()).transpose();
    text.map_err(|_| Refusal::Request("a header that is not ASCII"))
}

/// The beginning of a client's header, for the journal.
fn shown(words: &str) -> String {
    words.chars().take(SHOWN_MAX).collect()
}

#[cfg(test)]
mod tests;
