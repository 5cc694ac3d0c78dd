//! A ROS recording as a log of sweeps, IMU samples and twists.

use super::Cloud;
use super::decode_transforms;
use super::imu::RosImu;
use super::recording::{Channel, Kind, Recording};
use super::transform::{Transform, Tree};
use super::twist::{RosTwist, find_twist};
use super::wire::{Encoding, Malformed};
use crate::limit::{is_instant, is_misread, no_instant};
use crate::sweep::{Polar, Turn};
use crate::{Counter, Error, Event, Extrinsics, InputInfo, Options, Source, counters::Counters};
use randt_geometry::{Pose2, elementary::atan2};
use randt_messages::{Header, ImuSample, SensorKind, Twist};
use std::collections::VecDeque;
use std::path::Path;

/// Sweeps from which a radar's turn is learned before the first is given out.
const LEARN_SWEEPS: usize = 8;
/// Most IMU samples held meanwhile: over a minute at 250 Hz.
const LEARN_SAMPLES: usize = 20_000;

/// A bag of any format that is being read. Its fields are the recording, the topics that matter,
/// what was learned of them, and what was counted.
pub(crate) struct RosSource {
    recording: Box<dyn Recording>,
    channels: Vec<Channel>,
    /// For messages to the user.
    path: String,
    info: InputInfo,
    counters: Counters,
    radar: Option<usize>,
    imu: Option<usize>,
    twist: Option<usize>,
    /// Whether the radar hangs upside down.
    mirrored: bool,
    turn: Option<Turn>,
    waiting: VecDeque<Decoded>,
    sweeps: u64,
    samples: u64,
    twists: u64,
}

/// A message that matters, before it gets its number.
enum Decoded {
    Cloud(Cloud),
    Imu(RosImu, i64),
    Twist(RosTwist, i64),
    Transforms(Vec<Transform>),
}

impl RosSource {
    /// Chooses the topics, reads the first sweeps and learns from them.
    pub fn open(
        mut recording: Box<dyn Recording>,
        path: &Path,
        options: &Options,
    ) -> Result<Self, Error> {
        let mut counters = Counters::default();
        let format = recording.format();
        let channels = recording.channels().to_vec();
        let first = channels.first();
        let encoding = first.map_or(Encoding::Ros1, |channel| channel.encoding);
        let mut choose = |kind, topic: &Option<String>| {
            choose(&channels, kind, topic.as_deref(), path, &mut counters)
        };
        let radar = choose(Kind::Cloud, &options.radar_topic)?;
        let imu = choose(Kind::Imu, &options.imu_topic)?;
        let twist = find_twist(&channels, options.twist_topic.as_deref(), path)?;
        if radar.is_none() && options.radar_required {
            // It may be the damage that hides the radar: read on to name it.
            while recording.next_message(&mut counters)?.is_some() {}
            recording.close(&mut counters);
            let damage = counters.list().into_iter().find(|counter| counter.loss);
            let damage = damage.map(|counter| format!("; {}", counter.first));
            return Err(Error::NoRadar {
                path: path.display().to_string(),
                topics: list(&channels) + &damage.unwrap_or_default(),
            });
        }
        let scans = radar.and_then(|radar| channels.get(radar));
        let scans = scans.map_or(0, |channel| channel.messages);
        let mut source = Self {
            recording,
            channels,
            path: path.display().to_string(),
            info: InputInfo {
                format,
                sensor: SensorKind::Unknown,
                scans: Some(scans),
                extrinsics: Extrinsics::default(),
                configuration: None,
            },
            counters,
            radar,
            imu,
            twist,
            mirrored: false,
            turn: None,
            waiting: VecDeque::new(),
            sweeps: 0,
            samples: 0,
            twists: 0,
        };
        source.learn(options, encoding)?;
        Ok(source)
    }

    /// Reads ahead: mounting, and what is the same in every turn.
    fn learn(&mut self, options: &Options, encoding: Encoding) -> Result<(), Error> {
        let mut tree = Tree::default();
        for bytes in self.recording.static_transforms() {
            match decode_transforms(bytes, encoding) {
                Ok(transforms) => transforms.into_iter().for_each(|t| tree.add(t)),
                Err(malformed) => self
                    .counters
                    .count_loss("transforms_malformed", 1, || malformed.to_string()),
            }
        }
        let (mut clouds, mut samples) = (0, 0);
        while clouds < LEARN_SWEEPS && samples < LEARN_SAMPLES {
            let Some(decoded) = self.decode_next()? else {
                break;
            };
            match decoded {
                Decoded::Transforms(transforms) => transforms.into_iter().for_each(|t| tree.add(t)),
                other => {
                    clouds += usize::from(matches!(other, Decoded::Cloud(_)));
                    samples += usize::from(matches!(other, Decoded::Imu(..) | Decoded::Twist(..)));
                    self.waiting.push_back(other);
                }
            }
        }
        self.mount(&tree);
        let sweep = |decoded: &Decoded| match decoded {
            Decoded::Cloud(cloud) => Some(Polar::from_cloud(cloud, self.mirrored).0),
            _ => None,
        };
        let sweeps: Vec<Polar> = self.waiting.iter().filter_map(sweep).collect();
        if self.radar.is_some() {
            let turn = Turn::learn(&sweeps, options, &mut self.counters);
            self.info.sensor = turn.sensor();
            self.turn = Some(turn);
        }
        Ok(())
    }

    /// Finds where the sensors sit from the frames of their first messages.
    fn mount(&mut self, tree: &Tree) {
        let radar = self.waiting.iter().find_map(|decoded| match decoded {
            Decoded::Cloud(cloud) => Some(cloud.header.frame.as_str()),
            _ => None,
        });
        let imu = self.waiting.iter().find_map(|decoded| match decoded {
            Decoded::Imu(imu, _) => Some(imu.header.frame.as_str()),
            _ => None,
        });
        let counters = &mut self.counters;
        let mut mounting = |frame: Option<&str>, name: &'static str| {
            let frame = frame?;
            let found = tree.in_base(frame);
            if found.is_none() {
                counters.count_event(name, 1, || {
                    format!("no static transform from base_link to {frame}: identity assumed")
                });
            }
            found
        };
        if let Some((translation, rotation)) = mounting(radar, "radar_mounting_assumed") {
            let forward: [f64; 3] = rotation.rotate([1.0, 0.0, 0.0].into()).into();
            let up: [f64; 3] = rotation.rotate([0.0, 0.0, 1.0].into()).into();
            let ([x_m, y_m, _], [fx, fy, _], [_, _, uz]) = (translation, forward, up);
            self.mirrored = uz < 0.0;
            self.info.extrinsics.radar = Some(Pose2::new(x_m, y_m, atan2(fy, fx)));
        }
        let imu = mounting(imu, "imu_mounting_assumed");
        self.info.extrinsics.imu = imu.map(|(_, rotation)| rotation);
    }

    /// The next message of a topic that matters; malformed ones are counted and stepped over.
    fn decode_next(&mut self) -> Result<Option<Decoded>, Error> {
        loop {
            let Some(raw) = self.recording.next_message(&mut self.counters)? else {
                self.recording.close(&mut self.counters);
                return Ok(None);
            };
            let (index, arrival_ns, offset, bytes) =
                (raw.channel, raw.arrival_ns, raw.offset, raw.bytes);
            let Some(&Channel { encoding, kind, .. }) = self.channels.get(index) else {
                continue;
            };
            let decoded = if Some(index) == self.radar {
                Cloud::decode(bytes, encoding).map(Decoded::Cloud)
            } else if Some(index) == self.imu {
                RosImu::decode(bytes, encoding).map(|imu| Decoded::Imu(imu, arrival_ns))
            } else if let (true, Kind::Twist(kind)) = (Some(index) == self.twist, kind) {
                RosTwist::decode(bytes, encoding, kind)
                    .map(|twist| Decoded::Twist(twist, arrival_ns))
            } else if kind == Kind::Transforms && self.turn.is_none() {
                decode_transforms(bytes, encoding).map(Decoded::Transforms)
            } else {
                continue;
            };
            match decoded {
                Ok(mut decoded) => {
                    if self.stamp(&mut decoded, arrival_ns) {
                        return Ok(Some(decoded));
                    }
                }
                Err(malformed) => self.count_malformed(index, offset, &malformed),
            }
        }
    }

    /// A publisher that leaves the stamp at zero is stamped on arrival; false where no measurement
    /// has the stamp.
    fn stamp(&mut self, decoded: &mut Decoded, arrival_ns: i64) -> bool {
        let header = match decoded {
            Decoded::Cloud(cloud) => &mut cloud.header,
            Decoded::Imu(imu, _) => &mut imu.header,
            Decoded::Twist(twist, _) => &mut twist.header,
            Decoded::Transforms(_) => return true,
        };
        if header.stamp_ns == 0 {
            header.stamp_ns = arrival_ns;
            let first = || format!("a message of frame {} without a stamp", header.frame);
            self.counters
                .count_event("stamps_taken_from_arrival", 1, first);
        }
        let (stamp_ns, path) = (header.stamp_ns, &self.path);
        if !is_instant(stamp_ns) {
            let first = || format!("{path}: {}", no_instant(stamp_ns));
            self.counters.count_loss("stamps_out_of_range", 1, first);
        }
        is_instant(stamp_ns)
    }

    fn count_malformed(&mut self, channel: usize, offset: u64, malformed: &Malformed) {
        let name = match channel {
            index if Some(index) == self.radar => "sweeps_malformed",
            index if Some(index) == self.imu => "imu_samples_malformed",
            index if Some(index) == self.twist => "twists_malformed",
            _ => "transforms_malformed",
        };
        let path = &self.path;
        self.counters.count_loss(name, 1, || {
            format!("{path}: chunk at byte {offset}: {malformed}")
        });
    }

    fn event(&mut self, decoded: Decoded) -> Option<Event> {
        match decoded {
            Decoded::Cloud(cloud) => {
                let (polar, without_direction) = Polar::from_cloud(&cloud, self.mirrored);
                let counters = &mut self.counters;
                let first = || "a return at range 0 has no direction".to_owned();
                counters.count_event("returns_at_range_zero", without_direction.into(), first);
                let stamp_ns = cloud.header.stamp_ns;
                let first = || format!("a NaN or infinite value in the sweep stamped {stamp_ns}");
                counters.count_event("returns_not_finite", cloud.not_finite.into(), first);
                let scan = self.turn.as_ref()?.build(polar, self.sweeps, counters);
                self.sweeps += 1;
                Some(Event::Scan(scan))
            }
            Decoded::Imu(imu, arrival_ns) => {
                let stamp_ns = imu.header.stamp_ns;
                let (rate_rad_s, acceleration_m_s2) = (imu.rate_rad_s, imu.acceleration_m_s2);
                if is_misread(
                    &mut self.counters,
                    stamp_ns,
                    &rate_rad_s,
                    &acceleration_m_s2,
                ) {
                    return None;
                }
                let header = Header {
                    sequence: self.samples,
                    stamp_ns,
                    ..Header::default()
                };
                self.samples += 1;
                Some(Event::Imu(ImuSample {
                    header,
                    device_ns: stamp_ns,
                    arrival_ns,
                    rate_rad_s,
                    acceleration_m_s2,
                }))
            }
            Decoded::Twist(twist, arrival_ns) => {
                let header = Header {
                    sequence: self.twists,
                    stamp_ns: twist.header.stamp_ns,
                    ..Header::default()
                };
                self.twists += 1;
                Some(Event::Twist(Twist {
                    header,
                    arrival_ns,
                    velocity: twist.velocity,
                    covariance: twist.covariance,
                }))
            }
            Decoded::Transforms(_) => None,
        }
    }
}

impl Source for RosSource {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        loop {
            let decoded = match self.waiting.pop_front() {
                None => self.decode_next()?,
                waiting => waiting,
            };
            let Some(decoded) = decoded else {
                return Ok(None);
            };
            if let Some(event) = self.event(decoded) {
                return Ok(Some(event));
            }
        }
    }

    fn counters(&self) -> Vec<Counter> {
        self.counters.list()
    }
}

/// The topics of a recording with their types, for an error's text.
pub(super) fn list(channels: &[Channel]) -> String {
    if channels.is_empty() {
        return "no topic".to_owned();
    }
    let topic = |channel: &Channel| format!("{} ({})", channel.topic, channel.type_name);
    channels.iter().map(topic).collect::<Vec<_>>().join(", ")
}

/// The topic asked for, or the one of the kind with the most messages.
fn choose(
    channels: &[Channel],
    kind: Kind,
    wanted: Option<&str>,
    path: &Path,
    counters: &mut Counters,
) -> Result<Option<usize>, Error> {
    let (type_name, counter) = match kind {
        Kind::Cloud => ("sensor_msgs/PointCloud2", "radar_topic_chosen"),
        _ => ("sensor_msgs/Imu", "imu_topic_chosen"),
    };
    let of_kind = || {
        let channels = channels.iter().enumerate();
        channels.filter(|(_, channel)| channel.kind == kind)
    };
    if let Some(topic) = wanted {
        let found = of_kind().find(|(_, channel)| channel.topic == topic);
        let missing = || Error::NoTopic {
            path: path.display().to_string(),
            topic: topic.to_owned(),
            wanted: type_name,
            topics: list(channels),
        };
        return Ok(Some(found.ok_or_else(missing)?.0));
    }
    // The first of those with the most.
    let best = of_kind().rev().max_by_key(|(_, channel)| channel.messages);
    if let Some((_, chosen)) = best
        && of_kind().count() > 1
    {
        counters.count_event(counter, 1, || {
            let others: Vec<_> = of_kind()
                .map(|(_, c)| format!("{} ({})", c.topic, c.messages))
                .collect();
            format!("{} of {}", chosen.topic, others.join(", "))
        });
    }
    Ok(best.map(|(index, _)| index))
}
