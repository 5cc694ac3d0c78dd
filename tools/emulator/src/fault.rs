//! What goes wrong with sensors, on demand.

use crate::Error;
use std::str::FromStr;

macro_rules! kinds {
    ($( $(#[doc = $doc:literal])+ $variant:ident = $name:literal ),+ $(,)?) => {
        /// What goes wrong.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum FaultKind { $( $(#[doc = $doc])+ $variant ),+ }

        impl FaultKind {
            /// All of them.
            pub const ALL: &'static [Self] = &[ $( Self::$variant ),+ ];

            /// Its name on the command line.
            pub fn name(self) -> &'static str {
                match self { $( Self::$variant => $name ),+ }
            }

            /// What it does, in a line.
            pub fn about(self) -> &'static str {
                match self { $( Self::$variant => concat!($($doc),+).trim_ascii() ),+ }
            }
        }
    };
}

kinds! {
    /// Nothing is sent, the connection stays.
    Silence = "silence",
    /// The connection is closed in the middle of a message, and the next one is accepted.
    Close = "close",
    /// The device is gone: connections are closed or the port taken away, and nothing answers.
    Unplug = "unplug",
    /// Each message arrives in pieces, and several at once.
    Split = "split",
    /// Bytes that belong to no message come before each tenth one.
    Junk = "junk",
    /// Each tenth message has a wrong checksum.
    Checksum = "checksum",
    /// Each tenth message is cut short.
    Cut = "cut",
    /// Messages have a version that is not there yet.
    Version = "version",
    /// Each tenth message claims to be longer than any can be.
    Oversize = "oversize",
    /// Before each tenth message comes another one, well-formed and with wrong content.
    Wrong = "wrong",
    /// Each twentieth beam or sample is not sent.
    Lost = "lost",
    /// Each twentieth beam is sent twice.
    Doubled = "doubled",
    /// Each twentieth beam comes after the one that follows it.
    Reordered = "reordered",
    /// Beams end at a third of their range: a contour is set.
    Contour = "contour",
    /// Beams are not evenly spaced, in angle and in time.
    Jitter = "jitter",
    /// The device's clock is 200 ppm fast.
    Skew = "skew",
    /// The device's clock begins anew at 0, once.
    ClockReset = "clock-reset",
    /// Only every second message is sent: the device has forgotten its rate.
    Rate = "rate",
}

impl FaultKind {
    /// Datagrams come whole, and have no connection.
    pub const NOT_OF_BEAM_UDP: &'static [Self] = &[Self::Close, Self::Split];
    /// Colossus has no checksums.
    pub const NOT_OF_NAVTECH: &'static [Self] = &[Self::Checksum];
    /// Samples have neither range nor order of their own, and these protocols no version.
    pub const NOT_OF_SERIAL: &'static [Self] =
        &[Self::Version, Self::Reordered, Self::Contour, Self::Jitter];
    /// Lines by datagrams come whole, and have no connection.
    pub const NOT_OF_LINE_BY_UDP: &'static [Self] = &[
        Self::Close,
        Self::Split,
        Self::Version,
        Self::Contour,
        Self::Jitter,
    ];
    /// Nor have they lengths and checksums where the vendor's library takes them from a server.
    pub const NOT_OF_PHIDGET: &'static [Self] = &[
        Self::Version,
        Self::Reordered,
        Self::Contour,
        Self::Jitter,
        Self::Checksum,
        Self::Cut,
        Self::Oversize,
        Self::Wrong,
    ];
}

/// One fault and its time, in seconds since the emulator's beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// What goes wrong.
    pub kind: FaultKind,
    /// When it begins, s.
    pub begin_s: f64,
    /// When it is over, s.
    pub end_s: f64,
}

impl FromStr for Fault {
    type Err = String;

    /// Reads `KIND@BEGIN+DURATION`.
    fn from_str(text: &str) -> Result<Self, String> {
        let names = || FaultKind::ALL.iter().map(|kind| kind.name());
        let form =
            || format!("{text}: a fault is KIND@BEGIN+DURATION in seconds, such as silence@10+2");
        let (kind, time) = text.split_once('@').ok_or_else(form)?;
        let (begin, duration) = time.split_once('+').ok_or_else(form)?;
        let seconds = |text: &str| {
            text.parse()
                .ok()
                .filter(|s: &f64| s.is_finite() && *s >= 0.0)
        };
        let begin_s = seconds(begin).ok_or_else(form)?;
        let duration_s = seconds(duration).ok_or_else(form)?;
        let kind = FaultKind::ALL.iter().find(|known| known.name() == kind);
        let kind = *kind.ok_or_else(|| {
            let names: Vec<&str> = names().collect();
            format!("{text}: the kinds are {}", names.join(", "))
        })?;
        Ok(Self {
            kind,
            begin_s,
            end_s: begin_s + duration_s,
        })
    }
}

/// All faults of a run.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    list: Vec<Fault>,
    seed: u64,
}

impl Faults {
    /// These.
    pub fn new(faults: Vec<Fault>) -> Self {
        Self {
            list: faults,
            seed: 1,
        }
    }

    /// Draws what is random in them by a seed.
    pub fn seeded(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// The seed of what is random in them.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Refuses faults that a protocol cannot have: nothing would happen, in silence.
    pub fn check(&self, protocol: &'static str, cannot: &[FaultKind]) -> Result<(), Error> {
        let can = |kind: &&FaultKind| !cannot.contains(kind);
        match self.list.iter().find(|fault| !can(&&fault.kind)) {
            None => Ok(()),
            Some(fault) => {
                let names = FaultKind::ALL.iter().filter(can).map(|kind| kind.name());
                Err(Error::Fault {
                    protocol,
                    fault: fault.kind.name(),
                    can: names.collect::<Vec<_>>().join(", "),
                })
            }
        }
    }

    /// Whether something goes wrong at a time, s since the beginning.
    pub fn is_on(&self, kind: FaultKind, at_s: f64) -> bool {
        self.list
            .iter()
            .any(|fault| fault.kind == kind && fault.begin_s <= at_s && at_s < fault.end_s)
    }

    /// How many faults of a kind have begun until a time, s: for those that happen once.
    pub fn begun(&self, kind: FaultKind, at_s: f64) -> usize {
        let begun = |fault: &&Fault| fault.kind == kind && fault.begin_s <= at_s;
        self.list.iter().filter(begun).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_read_and_on_in_its_time() {
        let faults = Faults::new(vec![
            "silence@10+2".parse().unwrap(),
            "clock-reset@3+0".parse().unwrap(),
        ]);
        let on = |at_s| faults.is_on(FaultKind::Silence, at_s);
        assert_eq!([9.9, 10.0, 11.9, 12.0].map(on), [false, true, true, false]);
        assert!(!faults.is_on(FaultKind::Close, 10.0));
        let begun = |at_s| faults.begun(FaultKind::ClockReset, at_s);
        assert_eq!([2.9, 3.0, 99.0].map(begun), [0, 1, 1]);
    }

    #[test]
    fn what_a_protocol_cannot_have_is_refused() {
        let faults = Faults::new(vec!["checksum@1+1".parse().unwrap()]);
        assert!(faults.check("mip", FaultKind::NOT_OF_SERIAL).is_ok());
        let refused = faults
            .check("navtech", FaultKind::NOT_OF_NAVTECH)
            .unwrap_err()
            .to_string();
        assert!(
            refused.contains("navtech cannot have the fault checksum") && refused.contains("close")
        );
    }

    #[test]
    fn what_is_no_fault_is_refused() {
        for text in ["silence", "silence@1", "silence@-1+2", "silence@1+x"] {
            let error = text.parse::<Fault>().unwrap_err();
            assert!(
                error.contains(text) && error.contains("silence@10+2"),
                "{error}"
            );
        }
        let error = "silent@1+2".parse::<Fault>().unwrap_err();
        assert!(error.contains("silence, close"), "{error}");
        for kind in FaultKind::ALL {
            assert!(!kind.about().is_empty() && kind.about().ends_with('.'));
        }
    }
}
