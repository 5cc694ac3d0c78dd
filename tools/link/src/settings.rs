//! What the section `[link]` says, checked.

use crate::keys::{BASE, check_name};
use crate::ports::index_of;
use randt_config::{Link, LinkRole, MapperHost};
use randt_messages::{Keyframe, MapperCorrection, MapperGraph, MapperGrid, StageHealthTopic};
use randt_messages::{OdometryStateTopic, Topic};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

/// What goes first, and in time.
const URGENT: [&str; 3] = [
    StageHealthTopic::NAME,
    OdometryStateTopic::NAME,
    MapperCorrection::NAME,
];
/// What the mapper publishes.
const OF_MAPPER: [&str; 3] = [MapperCorrection::NAME, MapperGraph::NAME, MapperGrid::NAME];
/// What a robot gets of a mapper at the base.
const DOWN: [&str; 2] = [MapperCorrection::NAME, MapperGraph::NAME];

/// A topic that is carried.
#[derive(Clone, Debug, PartialEq)]
pub struct Carried {
    pub topic: u8,
    pub name: String,
    /// Whether every message is sent, also late.
    pub is_every: bool,
    pub is_urgent: bool,
    /// Bytes a second, 0 for no limit.
    pub rate: f64,
}

/// A key of the section that cannot be what it is.
#[derive(Debug, thiserror::Error)]
#[error("link.{key} = {found:?}: {expected}")]
pub struct Wrong {
    pub key: &'static str,
    pub found: String,
    /// What would be right.
    pub expected: String,
}

/// The settings.
#[derive(Clone, Debug)]
pub struct Settings {
    pub is_base: bool,
    pub robot: String,
    pub address: String,
    pub keys: Option<PathBuf>,
    pub is_mapper_at_base: bool,
    pub rate_max: f64,
    /// Names that are refused.
    pub refused: Vec<String>,
    /// From the robot to the base, in the order in which they go.
    pub up: Vec<Carried>,
    /// From the base to the robot.
    pub down: Vec<Carried>,
}

impl Settings {
    /// Checks a section.
    pub fn new(link: &Link) -> Result<Self, Wrong> {
        check_name(&link.robot).map_err(|why| wrong("robot", &link.robot, &why.to_string()))?;
        if link.robot == BASE {
            return Err(wrong("robot", BASE, "another name: that is the base's own"));
        }
        let keys = (!link.keys.is_empty()).then(|| PathBuf::from(&link.keys));
        let addresses = link.address.to_socket_addrs();
        let addresses: Vec<SocketAddr> = addresses
            .map_err(|why| wrong("address", &link.address, &format!("ADDRESS:PORT ({why})")))?
            .collect();
        if keys.is_none() && !addresses.iter().all(|it| it.ip().is_loopback()) {
            let expected = "an address of this machine alone, or keys (randt-link keys, link.keys)";
            return Err(wrong("address", &link.address, expected));
        }
        let is_mapper_at_base = link.mapper == MapperHost::Base;
        let rates = rates(&link.topic_rates)?;
        let every: Vec<&str> = link.every.split_whitespace().collect();
        let names: Vec<&str> = link.topics.split_whitespace().collect();
        let expected = "topics of link.topics";
        if let Some(name) = every.iter().find(|name| !names.contains(name)) {
            return Err(wrong("every", name, expected));
        }
        if let Some((name, _)) = rates.iter().find(|(name, _)| !names.contains(name)) {
            return Err(wrong("topic_rates", name, expected));
        }
        let carried = |name: &str| -> Result<Carried, Wrong> {
            let expected = "topics of the bus (docs/bus.md)";
            let topic = index_of(name).ok_or_else(|| wrong("topics", name, expected))?;
            let rate = rates.iter().find(|(of, _)| *of == name);
            Ok(Carried {
                topic,
                name: name.to_owned(),
                is_every: every.contains(&name),
                is_urgent: URGENT.contains(&name),
                rate: rate.map_or(0.0, |(_, rate)| *rate),
            })
        };
        let of_mapper = |name: &&&str| is_mapper_at_base && OF_MAPPER.contains(*name);
        let up = names.iter().filter(|name| !of_mapper(name));
        let up = up
            .map(|name| carried(name))
            .collect::<Result<Vec<_>, _>>()?;
        if is_mapper_at_base && !up.iter().any(|it| it.name == Keyframe::NAME && it.is_every) {
            let expected = "odometry/keyframe/v1 among them: the mapper is at the base";
            return Err(wrong("every", &link.every, expected));
        }
        let down = DOWN.iter().filter(|_| is_mapper_at_base).map(|name| {
            Ok(Carried {
                is_every: false,
                is_urgent: true,
                ..carried(name)?
            })
        });
        Ok(Self {
            is_base: link.role == LinkRole::Base,
            robot: link.robot.clone(),
            address: link.address.clone(),
            keys,
            is_mapper_at_base,
            rate_max: link.rate_max,
            refused: link.refused.split_whitespace().map(str::to_owned).collect(),
            up,
            down: down.collect::<Result<_, _>>()?,
        })
    }

    /// What this end sends.
    pub fn outward(&self) -> &[Carried] {
        if self.is_base { &self.down } else { &self.up }
    }

    /// Who has to be at the other end, by its key.
    pub fn peer(&self) -> &str {
        if self.is_base { &self.robot } else { BASE }
    }

    /// Whether the robot is refused.
    pub fn is_refused(&self) -> bool {
        self.is_base && self.refused.contains(&self.robot)
    }
}

fn wrong(key: &'static str, found: &str, expected: &str) -> Wrong {
    Wrong {
        key,
        found: found.to_owned(),
        expected: expected.to_owned(),
    }
}

/// Topics with their rates.
fn rates(text: &str) -> Result<Vec<(&str, f64)>, Wrong> {
    let words = text.split_whitespace().map(|word| {
        let pair = word.split_once('=');
        let rate = pair.and_then(|(name, rate)| Some((name, rate.parse::<f64>().ok()?)));
        let rate = rate.filter(|(_, rate)| rate.is_finite() && *rate >= 0.0);
        rate.ok_or_else(|| {
            wrong(
                "topic_rates",
                word,
                "TOPIC=BYTES_PER_SECOND, separated by blanks",
            )
        })
    });
    words.collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    fn names(carried: &[Carried]) -> Vec<&str> {
        carried.iter().map(|it| it.name.as_str()).collect()
    }

    #[test]
    fn the_defaults_keep_to_loopback_and_a_mapper_at_the_base_turns_its_topics_round() {
        let settings = Settings::new(&Link::default()).unwrap();
        assert!(settings.up.len() == 6 && settings.down.is_empty());
        let link = Link {
            mapper: MapperHost::Base,
            ..Link::default()
        };
        let settings = Settings::new(&link).unwrap();
        let up = [
            "odometry/state/v1",
            "stage/health/v1",
            "odometry/keyframe/v1",
        ];
        assert_eq!(names(&settings.up), up);
        assert_eq!(names(&settings.down), DOWN);
    }

    #[test]
    fn what_cannot_be_is_named() {
        let refused = |change: fn(&mut Link)| {
            let mut link = Link::default();
            change(&mut link);
            Settings::new(&link).unwrap_err().to_string()
        };
        assert!(refused(|link| link.address = "0.0.0.0:7447".into()).contains("or keys"));
        assert!(refused(|link| link.robot = "base".into()).contains("base's own"));
        assert!(refused(|link| link.robot = "a/b".into()).contains("is no name"));
        assert!(refused(|link| link.topics = "odometry/state".into()).contains("odometry"));
        assert!(refused(|link| link.topic_rates = "mapper/grid/v1=fast".into()).contains("fast"));
        assert!(refused(|link| link.every = "radar/scan/v1".into()).contains("radar/scan/v1"));
    }
}
