//! `stage/health`: the state of a stage, as it publishes it.

use crate::{Header, layout::coded, plain};

/// Most ports of a stage that are reported: the recorder reads every topic.
pub const HEALTH_PORTS: usize = 12;

coded! {
    /// What a stage does.
    pub enum StageState {
        /// Not in its loop yet.
        #[default]
        Starting = 0 => "starting",
        /// In its loop.
        Running = 1 => "running",
        /// In its loop, but something is lost or missing.
        Degraded = 2 => "degraded",
        /// On its way out.
        Stopping = 3 => "stopping",
        /// At the end of its log; what it sent last stays in reach.
        Finished = 4 => "finished",
    }
}

plain! {
    /// One port of a stage: what went through it since the stage started.
    pub struct PortHealth {
        /// Name of the topic, in UTF-8, filled with zeros.
        pub topic: [u8; 32],
        /// Messages sent or received.
        pub messages: u64,
        /// Messages that were missed.
        pub lost: u64,
        /// When the last one was published, ns; 0 for none.
        pub last_published_ns: i64,
        /// 1: the stage publishes here; 0: it reads.
        pub publishes: u64,
    }

    /// The state of one stage.
    pub struct StageHealth {
        /// `epoch` is the stage's own; stamp and publish time are now.
        pub header: Header,
        /// Name such as `odometry`, in UTF-8, filled with zeros.
        pub name: [u8; 16],
        /// What is wrong, in UTF-8, filled with zeros; empty where nothing is.
        pub message: [u8; 96],
        /// Process.
        pub pid: u64,
        /// When this process began, ns.
        pub started_ns: i64,
        /// Starts of this stage before this one, under this run folder.
        pub restarts: u64,
        /// Data lost in the stage itself, beyond what its ports missed.
        pub lost: u64,
        /// A [`StageState`] as its code.
        #[code(StageState)]
        pub state: u32,
        /// Ports in use.
        pub port_count: u32,
        /// The ports; entries from `port_count` on are zero.
        pub ports: [PortHealth; HEALTH_PORTS],
    }
}

impl StageHealth {
    /// The ports in use.
    pub fn ports(&self) -> &[PortHealth] {
        let count = (self.port_count as usize).min(HEALTH_PORTS);
        self.ports.get(..count).unwrap_or_default()
    }
}

/// Text in a fixed field, cut at a character's border, filled with zeros.
pub fn fixed_text<const N: usize>(text: &str) -> [u8; N] {
    let mut end = text.len().min(N);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut field = [0; N];
    for (to, from) in field.iter_mut().zip(&text.as_bytes()[..end]) {
        *to = *from;
    }
    field
}

/// The text of a fixed field; empty where it is none.
pub fn text_of(field: &[u8]) -> &str {
    let end = field.iter().position(|byte| *byte == 0);
    let bytes = field.get(..end.unwrap_or(field.len())).unwrap_or_default();
    core::str::from_utf8(bytes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_survives_its_field_and_is_cut_between_characters() {
        assert_eq!(text_of(&fixed_text::<16>("odometry")), "odometry");
        assert_eq!(text_of(&fixed_text::<4>("abüd")), "abü");
        assert_eq!(text_of(&fixed_text::<3>("abüd")), "ab");
        assert_eq!(text_of(&[0xff, 0]), "");
    }
}
