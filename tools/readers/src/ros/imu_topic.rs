//! Which IMU of a recording is used.

use super::imu::RosImu;
use super::recording::{Channel, Kind, Recording};
use super::topics::named;
use super::transform::{Tree, decode};
use crate::{Error, Options, counters::Counters};
use std::path::Path;

/// The IMU's topic: the one asked for; or the one whose frame has its place on the robot, of
/// several such the one with the most messages.
pub(super) fn choose_imu(
    recording: &dyn Recording,
    options: &Options,
    path: &Path,
    counters: &mut Counters,
) -> Result<Option<usize>, Error> {
    let channels = recording.channels();
    let is_imu = |channel: &Channel| channel.kind == Kind::Imu;
    if let Some(topic) = &options.imu_topic {
        let option = ("sensor_msgs/Imu", "--imu-topic");
        return named(channels, is_imu, topic, path, option).map(Some);
    }
    let of_kind = channels.iter().enumerate();
    let of_kind = of_kind.filter(|(_, channel)| is_imu(channel));
    let candidates: Vec<(usize, &Channel)> = of_kind.collect();
    let mounted = match candidates.len() {
        0 | 1 => vec![false; candidates.len()],
        _ => are_mounted(recording, &candidates),
    };
    // The first of equals.
    let ranked = candidates.iter().zip(mounted).rev();
    let best = ranked.max_by_key(|((_, channel), is_mounted)| (*is_mounted, channel.messages));
    if let Some(((_, chosen), _)) = best
        && candidates.len() > 1
    {
        counters.count_event("imu_topic_chosen", 1, || {
            let topic = |(_, c): &(usize, &Channel)| format!("{} ({})", c.topic, c.messages);
            let others: Vec<_> = candidates.iter().map(topic).collect();
            format!(
                "{} of {}; --imu-topic names another",
                chosen.topic,
                others.join(", ")
            )
        });
    }
    Ok(best.map(|((index, _), _)| *index))
}

/// Whether the frames of these topics' first messages have a place on the robot. A camera has an
/// IMU of its own, of whose place a recording may know nothing.
fn are_mounted(recording: &dyn Recording, candidates: &[(usize, &Channel)]) -> Vec<bool> {
    let mut tree = Tree::default();
    let encoding = candidates.first().map(|(_, channel)| channel.encoding);
    for bytes in recording.static_transforms() {
        let transforms = encoding.and_then(|encoding| decode(bytes, encoding).ok());
        transforms.into_iter().flatten().for_each(|t| tree.add(t));
    }
    let indices: Vec<usize> = candidates.iter().map(|(index, _)| *index).collect();
    let firsts = recording.first_messages(&indices).into_iter();
    let is_mounted = |(first, (_, channel)): (Option<Vec<u8>>, &(usize, &Channel))| {
        let imu = first.and_then(|bytes| RosImu::decode(&bytes, channel.encoding).ok());
        imu.is_some_and(|imu| tree.in_base(&imu.header.frame).is_some())
    };
    firsts.zip(candidates).map(is_mounted).collect()
}
