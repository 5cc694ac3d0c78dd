//! Which topics of a recording are used.

use super::Cloud;
use super::recording::{Channel, Kind, RadarKind};
use crate::polar_image::PolarImage;
use crate::ros::navtech::{BScan, Fft};
use crate::ros::polar::RosImage;
use crate::{Error, Options, counters::Counters, ros::Recording};
use std::path::Path;

/// Pieces of names by which a topic is that of a radar.
const RADAR_NAMES: [&str; 3] = ["radar", "navtech", "radar_data"];

/// The topics of a recording with their types, for an error's text.
pub(super) fn list(channels: &[Channel]) -> String {
    if channels.is_empty() {
        return "no topic".to_owned();
    }
    let topic = |channel: &Channel| format!("{} ({})", channel.topic, channel.type_name);
    channels.iter().map(topic).collect::<Vec<_>>().join(", ")
}

/// The topic that an option names, among those of its kind; `(wanted, option)` says for an error's
/// text what is read by which option.
pub(super) fn named(
    channels: &[Channel],
    is_of_kind: impl Fn(&Channel) -> bool,
    topic: &str,
    path: &Path,
    (wanted, option): (&'static str, &'static str),
) -> Result<usize, Error> {
    let is_it = |channel: &Channel| is_of_kind(channel) && channel.topic == topic;
    let found = channels.iter().position(is_it);
    found.ok_or_else(|| Error::NoTopic {
        path: path.display().to_string(),
        topic: topic.to_owned(),
        wanted,
        option,
        topics: list(channels),
    })
}

/// How good a topic is for a radar; the greatest is taken.
type Rank = (u8, bool, u64);

/// The radar's topic: the one asked for, or the best of those whose first message can be decoded.
/// Also gives why the first message of none can be.
pub(super) fn choose_radar(
    recording: &dyn Recording,
    options: &Options,
    path: &Path,
    counters: &mut Counters,
) -> Result<Option<usize>, Error> {
    let channels = recording.channels();
    let is_radar = |channel: &Channel| matches!(channel.kind, Kind::Radar(_));
    if let Some(topic) = &options.radar_topic {
        let wanted = "sensor_msgs/PointCloud2, Image, LaserScan or Navtech's messages";
        let named = named(channels, is_radar, topic, path, (wanted, "--radar-topic"));
        return named.map(Some);
    }
    let candidates = channels.iter().enumerate();
    let candidates = candidates.filter(|(_, c)| is_radar(c) && c.messages > 0);
    let candidates: Vec<usize> = candidates.map(|(index, _)| index).collect();
    // Where there is no choice the reading proper shows what is wrong.
    let is_image = |channel: &Channel| channel.kind == Kind::Radar(RadarKind::Image);
    let needs_choice =
        candidates.len() > 1 || options.intensity_field.is_some() || channels.iter().any(is_image);
    let firsts = match needs_choice {
        true => recording.first_messages(&candidates),
        false => vec![None; candidates.len()],
    };
    let (mut best, mut refused): (Option<(Rank, usize)>, _) = (None, None);
    for (index, first) in candidates.iter().zip(firsts) {
        let Some(channel) = channels.get(*index) else {
            continue;
        };
        let quality = match first
            .as_deref()
            .map(|bytes| quality(bytes, channel, options))
        {
            // Damage hides the first message: what comes later may be good.
            None => 1,
            Some(Ok(quality)) => quality,
            Some(Err(why)) => {
                refused.get_or_insert((channel.topic.clone(), why));
                continue;
            }
        };
        let name = channel.topic.to_lowercase();
        let is_named = RADAR_NAMES.iter().any(|part| name.contains(part));
        let rank = (quality, is_named, channel.messages);
        // The first of equals.
        if best.is_none_or(|(known, _)| rank > known) {
            best = Some((rank, *index));
        }
    }
    if let (None, Some((topic, why))) = (best, refused) {
        return Err(Error::NotDecoded {
            path: path.display().to_string(),
            topic,
            why,
            topics: list(channels),
        });
    }
    if let Some((_, index)) = best
        && candidates.len() > 1
        && let Some(chosen) = channels.get(index)
    {
        counters.count_event("radar_topic_chosen", 1, || {
            let topic = |index: &usize| {
                let channel = channels.get(*index)?;
                Some(format!("{} ({})", channel.topic, channel.messages))
            };
            let others: Vec<_> = candidates.iter().filter_map(topic).collect();
            format!(
                "{} of {}; --radar-topic names another",
                chosen.topic,
                others.join(", ")
            )
        });
    }
    Ok(best.map(|(_, index)| index))
}

/// How much of a sweep a message has: 3 with intensities, 2 as a photograph might, 1 positions
/// only; or why it is none.
fn quality(bytes: &[u8], channel: &Channel, options: &Options) -> Result<u8, String> {
    let Kind::Radar(kind) = channel.kind else {
        return Err("no radar".to_owned());
    };
    let text = |malformed: super::wire::Malformed| malformed.to_string();
    let field = options.intensity_field.as_deref();
    Ok(match kind {
        RadarKind::Cloud => match Cloud::decode(bytes, channel.encoding, field).map_err(text)? {
            cloud if cloud.without_intensity.is_some() => 1,
            _ => 3,
        },
        RadarKind::LaserScan => {
            Cloud::decode_laser_scan(bytes, channel.encoding).map_err(text)?;
            0
        }
        RadarKind::Fft => Fft::decode(bytes, channel.encoding)
            .map(|_| 3)
            .map_err(text)?,
        RadarKind::BScan => BScan::decode(bytes, channel.encoding)
            .map(|_| 3)
            .map_err(text)?,
        RadarKind::Image => {
            let image = RosImage::decode(bytes, channel.encoding).map_err(text)?;
            PolarImage::from_pixels(image.pixels, image.width, image.height)?;
            2
        }
    })
}
