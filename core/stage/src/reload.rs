//! What systemd asks of a stage by signals: to end, and to read the configuration again, of which what can change live
//! does, and the rest is named.

use crate::{Error, wait::Descriptor};
use nix::sys::signal::{SigSet, Signal};
use nix::sys::signalfd::{SfdFlags, SignalFd};
use randt_config::{Config, Origins, SelectionArguments};
use std::os::fd::AsFd;

/// What may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// The end.
    Stop,
    /// The configuration read again.
    Reload,
}

/// The requests. SIGTERM is among them because systemd sends a SIGCONT right behind it, and iceoryx2 remembers only the
/// last signal: now and then a stage would not hear that it has to end.
#[derive(Debug)]
pub(crate) struct Requests(SignalFd);

impl Requests {
    /// Takes both signals from now on. Call it before there is another thread: one that has not blocked them dies of them.
    pub(crate) fn new() -> Result<Self, Error> {
        let mut signals = SigSet::empty();
        signals.add(Signal::SIGHUP);
        signals.add(Signal::SIGTERM);
        let fd = signals.thread_block().and_then(|()| {
            let flags = SfdFlags::SFD_NONBLOCK | SfdFlags::SFD_CLOEXEC;
            SignalFd::with_flags(&signals, flags)
        });
        Ok(Self(fd.map_err(|cause| {
            Error::bus("SIGHUP and SIGTERM", cause)
        })?))
    }

    /// What to sleep on.
    pub(crate) fn descriptor(&self) -> Result<Descriptor<'_>, Error> {
        Descriptor::new(self.0.as_fd())
    }

    /// One that was made since the last look.
    pub(crate) fn take(&self) -> Option<Asked> {
        let signal = self.0.read_signal().ok().flatten()?;
        let is_end = signal.ssi_signo == Signal::SIGTERM as u32;
        Some(if is_end { Asked::Stop } else { Asked::Reload })
    }
}

/// The configuration of a stage: how it is read, and what the stage makes of it.
#[derive(Debug)]
pub(crate) struct Followed {
    selection: SelectionArguments,
    config: Config,
    reads: Vec<&'static str>,
    live: Option<&'static str>,
}

/// What came of reading it again.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    /// A configuration in which only what can change live has changed, where it has.
    pub live: Option<Config>,
    /// What is to be said of it, line by line.
    pub says: Vec<String>,
}

impl Followed {
    /// `reads`: sections that matter to the stage; `live`: the one that it takes without a restart.
    pub(crate) fn new(
        selection: &SelectionArguments,
        config: &Config,
        reads: &[&'static str],
        live: Option<&'static str>,
    ) -> Self {
        Self {
            selection: selection.clone(),
            config: config.clone(),
            reads: reads.to_vec(),
            live,
        }
    }

    /// Reads it again. An error is that of the configuration: what was in force stays so.
    pub(crate) fn read_again(&mut self, stage: &str) -> Result<Changes, randt_config::Error> {
        let loaded = self.selection.load(None)?;
        Ok(self.take(stage, &loaded.config, &loaded.origins))
    }

    fn take(&mut self, stage: &str, new: &Config, origins: &Origins) -> Changes {
        let mut changes = Changes::default();
        for section in Config::SECTIONS {
            let is_live = self.live == Some(section.name);
            if !is_live && !self.reads.contains(&section.name) {
                continue;
            }
            for key in section.keys {
                let value = |config: &Config| config.get(section.name, key.name);
                let (Some(before), Some(now)) = (value(&self.config), value(new)) else {
                    continue;
                };
                if before == now {
                    continue;
                }
                let place = origins.get(&(section.name, key.name));
                let place = place.map_or("default".to_owned(), ToString::to_string);
                let name = format!("{}.{}", section.name, key.name);
                changes.says.push(if is_live {
                    format!("{name} is {now} from now on, not {before} ({place})")
                } else {
                    format!(
                        "{name} is {now} ({place}), but {before} stays in force: it needs a restart \
                         (systemctl restart randt-{stage})"
                    )
                });
            }
        }
        match self.live {
            Some("radar") if self.config.radar != new.radar => {
                self.config.radar = new.radar.clone();
                changes.live = Some(self.config.clone());
            }
            Some("imu") if self.config.imu != new.imu => {
                self.config.imu = new.imu.clone();
                changes.live = Some(self.config.clone());
            }
            _ => {}
        }
        if changes.says.is_empty() {
            changes.says.push("nothing of it has changed".to_owned());
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn followed(reads: &[&'static str], live: Option<&'static str>) -> Followed {
        let selection = SelectionArguments::default();
        Followed::new(&selection, &Config::default(), reads, live)
    }

    #[test]
    fn what_can_change_live_does_and_the_rest_needs_a_restart() {
        let mut new = Config::default();
        new.radar.address = "10.0.0.9:6317".to_owned();
        new.sensor.keep_power += 1.0;
        new.ndt.cell_size_m = 7.0;
        let mut radar = followed(&["sensor"], Some("radar"));
        let changes = radar.take("radar", &new, &Origins::new());
        let live = changes.live.unwrap();
        assert_eq!(live.radar.address, "10.0.0.9:6317");
        assert_eq!(live.sensor, Config::default().sensor);
        assert_eq!(changes.says.len(), 2, "{:?}", changes.says);
        assert!(changes.says[0].contains("sensor.keep_power"));
        assert!(changes.says[0].contains("systemctl restart randt-radar"));
        assert!(changes.says[1].starts_with("radar.address is \"10.0.0.9:6317\" from now on"));
        // What was not taken is said again.
        let changes = radar.take("radar", &new, &Origins::new());
        assert!(changes.live.is_none());
        assert_eq!(changes.says.len(), 1);
    }

    #[test]
    fn what_does_not_concern_a_stage_is_not_said() {
        let mut new = Config::default();
        new.ndt.cell_size_m = 7.0;
        let changes = followed(&["filter"], None).take("filter", &new, &Origins::new());
        assert_eq!(changes.says, ["nothing of it has changed"]);
    }
}
