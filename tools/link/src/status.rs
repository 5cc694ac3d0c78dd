//! How the link is, in words.

use crate::peer::{Peer, Refusal};
use crate::settings::Settings;
use std::collections::BTreeSet;

/// Silence after which the other end is named as away, s.
const AWAY_S: f64 = 3.0;
/// How long ago another one of the peer's name was heard at most for it to be there still, s.
const TWIN_S: f64 = 10.0;
/// Different remarks that are logged; a stranger can make any number.
const LOGGED_MAX: usize = 64;

/// What is known beside the peer.
pub struct Status {
    is_base: bool,
    peer: String,
    is_refused: bool,
    fault: String,
    /// Who was refused last, and why.
    refused: String,
    /// When another one of the peer's name was heard, ns.
    twin_ns: Option<i64>,
    logged: BTreeSet<String>,
    news: Vec<String>,
    begun_ns: Option<i64>,
    /// When the rate was measured last, ns, bytes then, and the rates, bytes a second.
    measured: Option<(i64, u64, u64)>,
    rates: (f64, f64),
}

impl Status {
    /// Nothing is known yet.
    pub fn new(settings: &Settings) -> Self {
        Self {
            is_base: settings.is_base,
            peer: settings.peer().to_owned(),
            is_refused: settings.is_refused(),
            fault: String::new(),
            refused: String::new(),
            twin_ns: None,
            logged: BTreeSet::new(),
            news: Vec::new(),
            begun_ns: None,
            measured: None,
            rates: (0.0, 0.0),
        }
    }

    /// The link cannot be opened.
    pub fn set_fault(&mut self, why: &str) {
        why.clone_into(&mut self.fault);
    }

    /// It is open.
    pub fn set_open(&mut self) {
        self.fault.clear();
    }

    /// A frame was refused.
    pub fn set_refusal(&mut self, refusal: &Refusal, now_ns: i64) {
        if *refusal == Refusal::Former {
            self.twin_ns = Some(now_ns);
        }
        self.refuse(&refusal.to_string());
    }

    /// Zenoh has something to say of a connection.
    pub fn remark(&mut self, text: &str) {
        if let Some(name) = name_in(text) {
            if name == self.peer && !self.is_refused {
                return;
            }
            let why = match self.is_refused && name == self.peer {
                true => "it is in link.refused",
                false => "another one's",
            };
            self.refuse(&format!("refused: key of {name:?}, {why}"));
        } else if let Some(why) = key_fault(text) {
            self.refuse(&format!("refused: {why}"));
        }
    }

    fn refuse(&mut self, text: &str) {
        text.clone_into(&mut self.refused);
        if self.logged.len() < LOGGED_MAX && self.logged.insert(text.to_owned()) {
            self.news.push(text.to_owned());
        }
    }

    /// What is to be logged.
    pub fn take_news(&mut self) -> Vec<String> {
        std::mem::take(&mut self.news)
    }

    /// What is wrong, the worst first.
    pub fn problem(&mut self, peer: &Peer, of_end: &str, now_ns: i64) -> String {
        let begun_ns = *self.begun_ns.get_or_insert(now_ns);
        if !self.fault.is_empty() {
            return self.fault.clone();
        }
        let since_ns = peer.heard_ns().unwrap_or(begun_ns);
        let silent_s = now_ns.saturating_sub(since_ns) as f64 * 1e-9;
        if silent_s > AWAY_S {
            // Whole seconds: each text is a line in the journal, so they are tens and more.
            let since = match peer.heard_ns() {
                None => "yet".to_owned(),
                Some(_) => format!("for {}", rounded(silent_s)),
            };
            // A message of the bus is short, and the reason says more.
            let refused = match self.refused.as_str() {
                "" => String::new(),
                text => format!("{text}; "),
            };
            return format!("{refused}no word from {} {since}", self.other());
        }
        let is_near = |twin_ns: i64| (now_ns.saturating_sub(twin_ns) as f64) < TWIN_S * 1e9;
        if self.twin_ns.is_some_and(is_near) {
            return format!("refused: {}", Refusal::Former);
        }
        of_end.to_owned()
    }

    fn other(&self) -> String {
        match self.is_base {
            true => format!("robot {}", self.peer),
            false => "the base".to_owned(),
        }
    }

    /// How it goes.
    pub fn summary(&mut self, peer: &Peer, now_ns: i64) -> String {
        let (sent, received) = (peer.bytes_sent, peer.bytes_received);
        let (then_ns, sent_then, received_then) =
            *self.measured.get_or_insert((now_ns, sent, received));
        let passed_s = now_ns.saturating_sub(then_ns) as f64 * 1e-9;
        if passed_s >= 2.0 {
            self.rates.0 = (sent - sent_then) as f64 / passed_s;
            self.rates.1 = (received - received_then) as f64 / passed_s;
            self.measured = Some((now_ns, sent, received));
        }
        let clock = peer.clock_offset.estimate_ns();
        let clock = clock.map_or(String::new(), |(offset_ns, off_ns)| {
            format!(
                ", its clock {:+.3} s off (±{:.0} ms)",
                offset_ns as f64 * 1e-9,
                off_ns as f64 * 1e-6
            )
        });
        format!(
            "{}: {:.1} kB/s there, {:.1} back{clock}",
            self.other(),
            self.rates.0 * 1e-3,
            self.rates.1 * 1e-3,
        )
    }
}

/// Whole powers of two seconds, so that a break is a few lines of the journal.
fn rounded(silent_s: f64) -> String {
    let mut step = 4_u64;
    while (step * 2) as f64 <= silent_s {
        step *= 2;
    }
    match silent_s < 4.0 {
        true => "3 s".to_owned(),
        false => format!("{step} s and more"),
    }
}

/// The name in a key that was shown, in Zenoh's words.
fn name_in(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once("Common Name: ")?;
    let end = |at: char| !(at.is_ascii_alphanumeric() || at == '-' || at == '_');
    rest.split(end).next()
}

/// What is wrong with a key, by rustls's words.
fn key_fault(text: &str) -> Option<String> {
    // The other end takes back what this one has shown.
    if let Some((_, alert)) = text.split_once("received fatal alert: ") {
        let alert = alert.split(|at: char| !at.is_ascii_alphanumeric()).next()?;
        return Some(match alert {
            "CertificateExpired" => "the other end says that this one's key has expired".to_owned(),
            _ => format!("the other end does not know this one's key ({alert})"),
        });
    }
    if text.contains("peer sent no certificates") {
        return Some("it has no key".to_owned());
    }
    let (_, why) = text.split_once("invalid peer certificate: ")?;
    let why = why.split([':', ';', '.']).next()?;
    let why = why.split(" at ").next()?;
    Some(match why {
        "certificate expired" | "Expired" => "its key has expired".to_owned(),
        "certificate not valid yet" | "NotValidYet" => "its key is not valid yet".to_owned(),
        _ => format!("its key is another authority's ({why})"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_break_is_a_few_lines() {
        let texts: BTreeSet<String> = (30..6000).map(|n| rounded(f64::from(n) * 0.1)).collect();
        assert_eq!(texts.len(), 9, "{texts:?}");
        assert_eq!(rounded(70.0), "64 s and more");
    }

    #[test]
    fn names_and_faults_are_found_in_what_zenoh_says() {
        let text = "Accepted TLS connection on 127.0.0.1:1: 127.0.0.1:2. Common Name: spot.";
        assert_eq!(name_in(text), Some("spot"));
        let fault = |text| key_fault(text).unwrap_or_default();
        let text =
            "invalid peer certificate: certificate expired: verification time 17. Hint: more";
        assert_eq!(fault(text), "its key has expired");
        let text = "TLS handshake error: invalid peer certificate: UnknownIssuer";
        assert_eq!(
            fault(text),
            "its key is another authority's (UnknownIssuer)"
        );
        let text = "received fatal alert: DecryptError. Hint";
        assert_eq!(
            fault(text),
            "the other end does not know this one's key (DecryptError)"
        );
        assert_eq!(key_fault("something else"), None);
    }
}
