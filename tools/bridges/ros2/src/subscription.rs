//! A topic of others, read in the type and with the quality that it is offered in.

use crate::bell::Bell;
use crate::names;
use crate::participant::{Described, Offer, Participant, Quality, Reader, Sample};
use rustdds::dds::result::CreateError;

/// Kept messages that have a whole sweep: of Navtech's images 1.5 MB each.
const SWEEPS: i32 = 16;
/// Other kept messages: at 250 Hz 8 s.
const SAMPLES: i32 = 2000;

/// A subscription to a topic, by the name that ROS has for it.
pub struct Subscription {
    topic: String,
    open: Option<(Asked, Reader)>,
}

/// What it was opened with.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Asked {
    type_name: String,
    quality: Quality,
}

impl Subscription {
    /// Nobody offers it yet.
    pub fn new(topic: String) -> Self {
        Self { topic, open: None }
    }

    /// The topic's name.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Reads as is now offered: reliably where all who publish are reliable, and what they keep for
    /// who comes late where all do. Gives whether it was opened anew.
    pub fn follow(
        &mut self,
        participant: &Participant,
        offers: &[Offer],
        bell: &Bell,
    ) -> Result<bool, CreateError> {
        let name = names::topic(&self.topic);
        let Some(asked) = self.ask(&name, offers) else {
            return Ok(false);
        };
        if self.open.as_ref().is_some_and(|(known, _)| *known == asked) {
            return Ok(false);
        }
        let described = Described {
            name: &name,
            type_name: &asked.type_name,
            quality: asked.quality,
        };
        let reader = participant.reader(&described, bell.rope())?;
        self.open = Some((asked, reader));
        Ok(true)
    }

    /// What to ask for; `None` where nobody offers anything.
    fn ask(&self, name: &str, offers: &[Offer]) -> Option<Asked> {
        let known = self.open.as_ref().map(|(asked, _)| &asked.type_name);
        let here = || offers.iter().filter(|offer| offer.topic == name);
        // Of several types the one that was first.
        let known = known.filter(|known| here().any(|offer| offer.type_name == **known));
        let type_name = known.or_else(|| here().next().map(|offer| &offer.type_name))?;
        let mut same = here().filter(|offer| offer.type_name == *type_name);
        let (mut is_reliable, mut is_kept) = (true, true);
        same.by_ref().for_each(|offer| {
            is_reliable &= offer.is_reliable;
            is_kept &= offer.is_kept;
        });
        let is_sweep = ["PointCloud2_", "Image_", "BScan"].iter();
        let is_sweep = is_sweep.copied().any(|part| type_name.contains(part));
        Some(Asked {
            type_name: type_name.clone(),
            quality: Quality {
                is_reliable,
                is_kept: is_reliable && is_kept,
                depth: if is_sweep { SWEEPS } else { SAMPLES },
            },
        })
    }

    /// The reader, where there is one.
    pub fn reader(&self) -> Option<&Reader> {
        self.open.as_ref().map(|(_, reader)| reader)
    }

    /// The messages that have come, with their type as ROS writes it.
    pub fn take(&self, mut each: impl FnMut(Result<(Sample, String), String>)) {
        if let Some((asked, reader)) = &self.open {
            let type_name = || names::ros_type(&asked.type_name);
            reader.take(|sample| each(sample.map(|sample| (sample, type_name()))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(type_name: &str, is_reliable: bool, is_kept: bool) -> Offer {
        Offer {
            topic: "rt/radar".to_owned(),
            type_name: names::message_type("sensor_msgs", type_name),
            is_reliable,
            is_kept,
        }
    }

    fn asked(offers: &[Offer]) -> Option<(bool, bool, i32)> {
        let quality = Subscription::new("/radar".to_owned())
            .ask("rt/radar", offers)?
            .quality;
        Some((quality.is_reliable, quality.is_kept, quality.depth))
    }

    #[test]
    fn no_more_is_asked_for_than_everyone_offers() {
        assert_eq!(asked(&[]), None);
        let good = || offer("PointCloud2", true, false);
        assert_eq!(asked(&[good()]), Some((true, false, SWEEPS)));
        let worse = offer("PointCloud2", false, false);
        assert_eq!(asked(&[good(), worse]), Some((false, false, SWEEPS)));
        assert_eq!(
            asked(&[offer("Imu", true, true)]),
            Some((true, true, SAMPLES))
        );
        // Of another type, or of another topic.
        assert_eq!(
            asked(&[good(), offer("Imu", false, false)]),
            Some((true, false, SWEEPS))
        );
        let mut elsewhere = good();
        elsewhere.topic = "rt/camera".to_owned();
        assert_eq!(asked(&[elsewhere]), None);
    }
}
