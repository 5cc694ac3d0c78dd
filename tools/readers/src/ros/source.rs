//! A ROS recording as a log of sweeps and IMU samples.

use super::Cloud;
use super::decode_transforms;
use super::imu::RosImu;
use super::recording::{Channel, Kind, Recording};
use super::transform::{Transform, Tree};
use super::wire::{Encoding, Malformed};
use crate::limit::{is_instant, misreading};
use crate::sweep::{Polar, Turn};
use crate::{Counter, Error, Event, Extrinsics, InputInfo, Options, Source, counters::Counters};
use randt_geometry::{Pose2, Quaternion, elementary::atan2};
use randt_messages::{Header, ImuSample, SensorKind};
use std::collections::VecDeque;
use std::path::Path;

/// Sweeps from which a radar's turn is learned before the first is given out.
const LEARN_SWEEPS: usize = 8;
/// Most IMU samples held meanwhile: over a minute at 250 Hz.
const LEARN_SAMPLES: usize = 20_000;

/// A bag of any format that is being read.
pub(crate) struct RosSource {
    recording: Box<dyn Recording>,
    channels: Vec<Channel>,
    /// For messages to the user.
    path: String,
    info: InputInfo,
    counters: Counters,
    radar: Option<usize>,
    imu: Option<usize>,
    /// Whether the radar hangs upside down.
    mirrored: bool,
    turn: Option<Turn>,
    waiting: VecDeque<Decoded>,
    sweeps: u64,
    samples: u64,
}

/// A message that matters, before it gets its number.
enum Decoded {
    Cloud(Cloud),
    Imu(RosImu, i64),
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
        let encoding = channels
            .first()
            .map_or(Encoding::Ros1, |channel| channel.encoding);
        let (radar_topic, imu_topic) =
            (options.radar_topic.as_deref(), options.imu_topic.as_deref());
        let radar = choose(&channels, Kind::Cloud, radar_topic, path, &mut counters)?;
        let imu = choose(&channels, Kind::Imu, imu_topic, path, &mut counters)?;
        if radar.is_none() && options.radar_required {
            // It may be the damage that hides the radar: read on to name it.
            while recording.next_message(&mut counters)?.is_some() {}
            recording.close(&mut counters);
            let damage = counters.list().into_iter().find(|counter| counter.loss);
            let damage = damage
                .map(|counter| format!("; {}", counter.first))
                .unwrap_or_default();
            return Err(Error::NoRadar {
                path: path.display().to_string(),
                topics: list(&channels) + &damage,
            });
        }
        let scans = radar
            .and_then(|radar| channels.get(radar))
            .map_or(0, |c| c.messages);
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
            mirrored: false,
            turn: None,
            waiting: VecDeque::new(),
            sweeps: 0,
            samples: 0,
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
                    samples += usize::from(matches!(other, Decoded::Imu(..)));
                    self.waiting.push_back(other);
                }
            }
        }
        self.mount(&tree);
        let sweeps: Vec<Polar> = self
            .waiting
            .iter()
            .filter_map(|decoded| match decoded {
                Decoded::Cloud(cloud) => Some(Polar::from_cloud(cloud, self.mirrored).0),
                _ => None,
            })
            .collect();
        if !sweeps.is_empty() {
            let turn = Turn::learn(&sweeps, options, &mut self.counters);
            self.info.sensor = turn.sensor();
            self.turn = Some(turn);
        } else if self.radar.is_some() {
            self.turn = Some(Turn::learn(&[], options, &mut self.counters));
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
        let imu: Option<Quaternion> =
            mounting(imu, "imu_mounting_assumed").map(|(_, rotation)| rotation);
        self.info.extrinsics.imu = imu;
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
            let Some(channel) = self.channels.get(index) else {
                continue;
            };
            let encoding = channel.encoding;
            let decoded = if Some(index) == self.radar {
                Cloud::decode(bytes, encoding).map(Decoded::Cloud)
            } else if Some(index) == self.imu {
                RosImu::decode(bytes, encoding).map(|imu| Decoded::Imu(imu, arrival_ns))
            } else if channel.kind == Kind::Transforms && self.turn.is_none() {
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
            Decoded::Transforms(_) => return true,
        };
        if header.stamp_ns == 0 {
            header.stamp_ns = arrival_ns;
            self.counters
                .count_event("stamps_taken_from_arrival", 1, || {
                    format!("a message of frame {} without a stamp", header.frame)
                });
        }
        let (stamp_ns, path) = (header.stamp_ns, &self.path);
        if !is_instant(stamp_ns) {
            self.counters.count_loss("stamps_out_of_range", 1, || {
                format!(
                    "{path}: stamp {stamp_ns}, which no measurement has; expected ns since 1970"
                )
            });
        }
        is_instant(stamp_ns)
    }

    fn count_malformed(&mut self, channel: usize, offset: u64, malformed: &Malformed) {
        let name = match channel {
            index if Some(index) == self.radar => "sweeps_malformed",
            index if Some(index) == self.imu => "imu_samples_malformed",
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
                self.counters.count_event(
                    "returns_at_range_zero",
                    u64::from(without_direction),
                    || "a return at range 0 has no direction".to_owned(),
                );
                self.counters.count_event(
                    "returns_not_finite",
                    u64::from(cloud.not_finite),
                    || {
                        format!(
                            "a NaN or infinite value in the sweep stamped {}",
                            cloud.header.stamp_ns
                        )
                    },
                );
                let scan = self
                    .turn
                    .as_ref()?
                    .build(polar, self.sweeps, &mut self.counters);
                self.sweeps += 1;
                Some(Event::Scan(scan))
            }
            Decoded::Imu(imu, arrival_ns) => {
                if let Some(name) = misreading(&imu.rate_rad_s, &imu.acceleration_m_s2) {
                    self.counters.count_loss(name, 1, || {
                        let (rate, acceleration) = (imu.rate_rad_s, imu.acceleration_m_s2);
                        format!(
                            "{rate:?} rad/s, {acceleration:?} m/s^2 in the sample stamped {}",
                            imu.header.stamp_ns
                        )
                    });
                    return None;
                }
                let header = Header {
                    sequence: self.samples,
                    stamp_ns: imu.header.stamp_ns,
                    ..Header::default()
                };
                self.samples += 1;
                Some(Event::Imu(ImuSample {
                    header,
                    device_ns: imu.header.stamp_ns,
                    arrival_ns,
                    rate_rad_s: imu.rate_rad_s,
                    acceleration_m_s2: imu.acceleration_m_s2,
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
                Some(decoded) => decoded,
                None => match self.decode_next()? {
                    Some(decoded) => decoded,
                    None => return Ok(None),
                },
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
fn list(channels: &[Channel]) -> String {
    if channels.is_empty() {
        return "no topic".to_owned();
    }
    let topics = channels
        .iter()
        .map(|c| format!("{} ({})", c.topic, c.type_name));
    topics.collect::<Vec<_>>().join(", ")
}

/// The topic asked for, or the one of the kind with the most messages.
fn choose(
    channels: &[Channel],
    kind: Kind,
    wanted: Option<&str>,
    path: &Path,
    counters: &mut Counters,
) -> Result<Option<usize>, Error> {
    let of_kind = || {
        channels
            .iter()
            .enumerate()
            .filter(|(_, channel)| channel.kind == kind)
    };
    if let Some(topic) = wanted {
        let found = of_kind().find(|(_, channel)| channel.topic == topic);
        return match found {
            Some((index, _)) => Ok(Some(index)),
            None => Err(Error::NoTopic {
                path: path.display().to_string(),
                topic: topic.to_owned(),
                wanted: if kind == Kind::Cloud {
                    "sensor_msgs/PointCloud2"
                } else {
                    "sensor_msgs/Imu"
                },
                topics: list(channels),
            }),
        };
    }
    let mut best: Option<(usize, &Channel)> = None;
    for (index, channel) in of_kind() {
        if best.is_none_or(|(_, known)| channel.messages > known.messages) {
            best = Some((index, channel));
        }
    }
    if let Some((_, chosen)) = best
        && of_kind().count() > 1
    {
        let name = if kind == Kind::Cloud {
            "radar_topic_chosen"
        } else {
            "imu_topic_chosen"
        };
        counters.count_event(name, 1, || {
            let others: Vec<_> = of_kind()
                .map(|(_, c)| format!("{} ({})", c.topic, c.messages))
                .collect();
            format!("{} of {}", chosen.topic, others.join(", "))
        });
    }
    Ok(best.map(|(index, _)| index))
}
