//! A ROS recording as a log of sweeps, IMU samples and twists.

mod decoded;
mod event;
mod learn;

use super::decode_transforms;
use super::imu_topic::choose_imu;
use super::navtech::{Configuration, FftTurn};
use super::recording::{Channel, Kind, RadarKind, Recording};
use super::stamp_check::StampCheck;
use super::topics::{choose_radar, list};
use super::twist::find_twist;
use super::wire::{Encoding, Malformed};
use crate::limit::{is_instant, no_instant};
use crate::sweep::Turn;
use crate::{
    Counter, Error, Event, Extrinsics, InputInfo, InputTopic, Options, Source, counters::Counters,
};
use decoded::Decoded;
use randt_messages::SensorKind;
use std::collections::VecDeque;
use std::path::Path;
use tempfile::TempPath;

/// A bag of any format that is being read. Its fields are the recording, the topics that matter,
/// what was learned of them, and what was counted.
pub(crate) struct RosSource {
    recording: Box<dyn Recording>,
    /// Files that were decompressed for it; they go away with it.
    _unpacked: Vec<TempPath>,
    channels: Vec<Channel>,
    /// For messages to the user.
    path: String,
    options: Options,
    info: InputInfo,
    counters: Counters,
    radar: Option<usize>,
    imu: Option<usize>,
    twist: Option<usize>,
    /// Whether azimuths are counted clockwise: the radar hangs upside down, or its driver does so.
    mirrored: bool,
    turn: Option<Turn>,
    /// A Navtech's turn of which some azimuths are here, its bins, and the time of a turn.
    fft_turn: FftTurn,
    last_arrival_ns: i64,
    navtech: Option<Configuration>,
    bin_m: Option<f64>,
    period_ns: i64,
    stamp_checks: [StampCheck; 3],
    waiting: VecDeque<(Decoded, i64)>,
    sweeps: u64,
    samples: u64,
    twists: u64,
}

impl RosSource {
    /// Chooses the topics, reads the first sweeps and learns from them.
    pub fn open(
        mut recording: Box<dyn Recording>,
        unpacked: Vec<TempPath>,
        path: &Path,
        options: &Options,
    ) -> Result<Self, Error> {
        let mut counters = Counters::default();
        let format = recording.format();
        let channels = recording.channels().to_vec();
        let first = channels.first();
        let encoding = first.map_or(Encoding::Ros1, |channel| channel.encoding);
        let radar = choose_radar(recording.as_ref(), options, path, &mut counters);
        let radar = match (radar, options.radar_required) {
            (Err(Error::NotDecoded { .. }), false) => None,
            (radar, _) => radar?,
        };
        let imu = choose_imu(recording.as_ref(), options, path, &mut counters)?;
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
        let chosen: Vec<usize> = [radar, imu, twist].into_iter().flatten().collect();
        recording.select(&chosen);
        let scans = radar.and_then(|radar| channels.get(radar));
        let azimuths = match scans.map(|channel| channel.kind) {
            Some(Kind::Radar(RadarKind::Fft)) => 400,
            _ => 1,
        };
        let scans = scans.map_or(0, |channel| channel.messages / azimuths);
        let topic = |(index, channel): (usize, &Channel)| InputTopic {
            name: channel.topic.clone(),
            type_name: channel.type_name.clone(),
            messages: channel.messages,
            used_as: match channel.kind {
                _ if Some(index) == radar => Some("radar"),
                _ if Some(index) == imu => Some("imu"),
                _ if Some(index) == twist => Some("twist"),
                Kind::StaticTransforms | Kind::Transforms => Some("mounting"),
                Kind::RadarConfiguration => Some("the radar's bins"),
                _ => None,
            },
        };
        let topics = channels.iter().enumerate().map(topic).collect();
        let mut source = Self {
            recording,
            _unpacked: unpacked,
            channels,
            path: path.display().to_string(),
            options: options.clone(),
            info: InputInfo {
                format,
                sensor: SensorKind::Unknown,
                scans: Some(scans),
                extrinsics: Extrinsics::default(),
                configuration: None,
                bin_size: None,
                without_intensity: None,
                topics,
            },
            counters,
            radar,
            imu,
            twist,
            mirrored: false,
            turn: None,
            fft_turn: FftTurn::default(),
            last_arrival_ns: 0,
            navtech: None,
            bin_m: None,
            period_ns: 0,
            stamp_checks: Default::default(),
            waiting: VecDeque::new(),
            sweeps: 0,
            samples: 0,
            twists: 0,
        };
        source.learn(encoding)?;
        Ok(source)
    }

    /// Whether there were sweeps to learn from.
    pub fn has_learned(&self) -> bool {
        let mut waiting = self.waiting.iter();
        waiting.any(|(decoded, _)| matches!(decoded, Decoded::Cloud(_) | Decoded::Polar(..)))
    }

    /// The next message of a topic that matters, with when it was recorded; malformed ones are
    /// counted and stepped over.
    fn decode_next(&mut self) -> Result<Option<(Decoded, i64)>, Error> {
        loop {
            let Some(raw) = self.recording.next_message(&mut self.counters)? else {
                if self.recording.is_live() {
                    return Ok(None);
                }
                self.recording.close(&mut self.counters);
                let turn = self.navtech.map(|navtech| navtech.encoder_turn);
                let last = self
                    .fft_turn
                    .take(turn)
                    .and_then(|turn| Decoded::fft_turn(turn).ok());
                return Ok(last.map(|last| (last, self.last_arrival_ns)));
            };
            let (index, arrival_ns, offset, bytes) =
                (raw.channel, raw.arrival_ns, raw.offset, raw.bytes);
            let Some(&Channel { encoding, kind, .. }) = self.channels.get(index) else {
                continue;
            };
            self.last_arrival_ns = arrival_ns;
            let decoded = if kind == Kind::RadarConfiguration {
                // The first one holds; they are sent again and again.
                let found = Configuration::decode(bytes, encoding).ok();
                self.navtech = self.navtech.or(found);
                continue;
            } else if let (true, Kind::Radar(kind)) = (Some(index) == self.radar, kind) {
                let turn = self.navtech.map(|navtech| navtech.encoder_turn);
                let field = self.options.intensity_field.as_deref();
                Decoded::radar(bytes, encoding, (kind, field), &mut self.fft_turn, turn)
            } else if Some(index) == self.imu {
                Decoded::imu(bytes, encoding).map(Some)
            } else if let (true, Kind::Twist(kind)) = (Some(index) == self.twist, kind) {
                Decoded::twist(bytes, encoding, kind).map(Some)
            } else if kind == Kind::Transforms && self.turn.is_none() {
                decode_transforms(bytes, encoding).map(|t| Some(Decoded::Transforms(t)))
            } else {
                continue;
            };
            match decoded {
                Ok(None) => {}
                Ok(Some(mut decoded)) => {
                    let learning = self.turn.is_none() && self.period_ns == 0;
                    if self.stamp(&mut decoded, arrival_ns)
                        && (learning || self.has_good_stamp(&decoded, arrival_ns))
                    {
                        return Ok(Some((decoded, arrival_ns)));
                    }
                }
                Err(malformed) => self.count_malformed(index, offset, &malformed),
            }
        }
    }

    /// A publisher that leaves the stamp at zero is stamped on arrival; false where no measurement
    /// has the stamp.
    fn stamp(&mut self, decoded: &mut Decoded, arrival_ns: i64) -> bool {
        let Some(header) = decoded.header_mut() else {
            return true;
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
}

impl Source for RosSource {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn set_bin_size(&mut self, size_m: f64) {
        self.bin_m = Some(size_m);
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        loop {
            let decoded = match self.waiting.pop_front() {
                None => self.decode_next()?,
                waiting => waiting,
            };
            let Some((decoded, arrival_ns)) = decoded else {
                return Ok(None);
            };
            if let Some(event) = self.event(decoded, arrival_ns)? {
                return Ok(Some(event));
            }
        }
    }

    fn counters(&self) -> Vec<Counter> {
        self.counters.list()
    }
}
