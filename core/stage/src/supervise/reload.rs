//! The configuration read again: what can change live does, and the rest is named.

use randt_config::{Config, Origins, SelectionArguments};

/// The configuration of a stage: how it is read, and which of its sections the stage uses.
#[derive(Debug)]
pub(crate) struct FollowedConfiguration {
    selection: SelectionArguments,
    config: Config,
    /// Sections that matter to the stage.
    reads: Vec<&'static str>,
    /// The section that it takes without a restart.
    live: Option<&'static str>,
    /// A configuration in which only that section has changed, until the stage takes it over.
    pub changed: Option<Config>,
}

impl FollowedConfiguration {
    /// `reads`: sections that matter to the stage; `live`: the one that it takes without a
    /// restart.
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
            changed: None,
        }
    }

    /// Reads it again; returns what is to be logged, line by line. An error is that of the
    /// configuration: what was in force stays in force.
    pub(crate) fn read_again(&mut self, stage: &str) -> Result<Vec<String>, randt_config::Error> {
        let loaded = self.selection.load(None)?;
        Ok(self.compare(stage, &loaded.config, &loaded.origins))
    }

    fn compare(&mut self, stage: &str, new: &Config, origins: &Origins) -> Vec<String> {
        let mut messages = Vec::new();
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
                let written = origins.get(&(section.name, key.name));
                let place = written.map_or("default".to_owned(), ToString::to_string);
                let name = format!("{}.{}", section.name, key.name);
                messages.push(if is_live {
                    format!("{name} is {now} from now on, not {before} ({place})")
                } else {
                    format!(
                        "{name} is {now} ({place}), but {before} stays in force: it needs a restart \
                         (systemctl restart randt-{stage})"
                    )
                });
            }
        }
        let mut config = self.config.clone();
        match self.live {
            Some("radar") => config.radar.clone_from(&new.radar),
            Some("imu") => config.imu.clone_from(&new.imu),
            _ => {}
        }
        self.changed = (config != self.config).then(|| config.clone());
        self.config = config;
        if messages.is_empty() {
            messages.push("nothing of it has changed".to_owned());
        }
        messages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn followed(reads: &[&'static str], live: Option<&'static str>) -> FollowedConfiguration {
        let selection = SelectionArguments::default();
        FollowedConfiguration::new(&selection, &Config::default(), reads, live)
    }

    #[test]
    fn what_can_change_live_does_and_the_rest_needs_a_restart() {
        let mut new = Config::default();
        new.radar.address = "10.0.0.9:6317".to_owned();
        new.sensor.keep_power += 1.0;
        new.ndt.cell_size_m = 7.0;
        let mut radar = followed(&["sensor"], Some("radar"));
        let messages = radar.compare("radar", &new, &Origins::new());
        let live = radar.changed.take().unwrap();
        assert_eq!(live.radar.address, "10.0.0.9:6317");
        assert_eq!(live.sensor, Config::default().sensor);
        assert_eq!(messages.len(), 2, "{:?}", messages);
        assert!(messages[0].contains("sensor.keep_power"));
        assert!(messages[0].contains("systemctl restart randt-radar"));
        assert!(messages[1].starts_with("radar.address is \"10.0.0.9:6317\" from now on"));
        // What was not taken is logged again.
        let messages = radar.compare("radar", &new, &Origins::new());
        assert!(radar.changed.is_none());
        assert_eq!(messages.len(), 1);
    }

    #[test]
    fn what_does_not_concern_a_stage_is_not_logged() {
        let mut new = Config::default();
        new.ndt.cell_size_m = 7.0;
        let messages = followed(&["filter"], None).compare("filter", &new, &Origins::new());
        assert_eq!(messages, ["nothing of it has changed"]);
    }
}
