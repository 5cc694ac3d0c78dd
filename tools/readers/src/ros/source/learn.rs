//! What the first messages say of the whole recording: mounting, the radar's turn, its bins.

use super::RosSource;
use super::decoded::Decoded;
use crate::ros::decode_transforms;
use crate::ros::recording::{Kind, RadarKind};
use crate::ros::stamp_check::StampCheck;
use crate::ros::transform::Tree;
use crate::ros::wire::Encoding;
use crate::sweep::{Polar, Turn, are_sectors};
use crate::{BinSize, Error};
use randt_geometry::{Pose2, elementary::atan2};
use randt_messages::SensorKind;

/// Sweeps from which a radar's turn is learned before the first is given out.
const LEARN_SWEEPS: usize = 8;
/// Most IMU samples held meanwhile: over a minute at 250 Hz.
const LEARN_SAMPLES: usize = 20_000;

impl RosSource {
    /// Reads ahead: mounting, and what is the same in every turn.
    pub(super) fn learn(&mut self, encoding: Encoding) -> Result<(), Error> {
        let mut tree = Tree::default();
        for bytes in self.recording.static_transforms() {
            match decode_transforms(bytes, encoding) {
                Ok(transforms) => transforms.into_iter().for_each(|t| tree.add(t)),
                Err(malformed) => self
                    .counters
                    .count_loss("transforms_malformed", 1, || malformed.to_string()),
            }
        }
        let (mut sweeps, mut samples) = (0, 0);
        while sweeps < LEARN_SWEEPS && samples < LEARN_SAMPLES {
            let Some((decoded, arrival_ns)) = self.decode_next()? else {
                break;
            };
            match decoded {
                Decoded::Transforms(transforms) => transforms.into_iter().for_each(|t| tree.add(t)),
                other => {
                    sweeps += usize::from(matches!(other, Decoded::Cloud(_) | Decoded::Polar(..)));
                    samples += usize::from(matches!(other, Decoded::Imu(..) | Decoded::Twist(..)));
                    self.waiting.push_back((other, arrival_ns));
                }
            }
        }
        self.learn_stamps();
        self.mount(&tree);
        if self.radar.is_none() {
            return Ok(());
        }
        let is_polar = |(decoded, _): &(Decoded, i64)| matches!(decoded, Decoded::Polar(..));
        if self.waiting.iter().any(is_polar) {
            self.learn_bins();
            return Ok(());
        }
        let mirrored = self.mirrored;
        let mut clouds = self
            .waiting
            .iter()
            .filter_map(|(decoded, _)| match decoded {
                Decoded::Cloud(cloud) => Some(cloud),
                _ => None,
            });
        let without = clouds
            .clone()
            .find_map(|cloud| cloud.without_intensity.clone());
        let assumed = clouds
            .clone()
            .find_map(|cloud| cloud.assumed_intensity.clone());
        let is_navtech = clouds.clone().any(|cloud| cloud.is_navtech);
        let flipped = self.options.mirrored.unwrap_or(is_navtech);
        self.mirrored = mirrored != flipped;
        let sweeps: Vec<Polar> = clouds
            .by_ref()
            .map(|cloud| Polar::from_cloud(cloud, self.mirrored).0)
            .collect();
        if flipped && self.options.mirrored.is_none() {
            self.counters.count_event("clouds_mirrored", 1, || {
                "the clouds of Navtech's driver count azimuths clockwise: y is turned (--mirrored no leaves it)".to_owned()
            });
        }
        if let Some(fields) = &without {
            self.counters.count_event("returns_without_intensity", 1, || {
                format!("no field intensity among {fields}: NDT in two dimensions (--intensity-field NAME takes another)")
            });
        }
        if let Some(field) = &assumed {
            self.counters.count_event("intensity_assumed", 1, || {
                format!("the field {field} is taken for the intensity (--intensity-field NAME takes another)")
            });
        }
        self.info.without_intensity = without;
        let kind = self.radar.and_then(|radar| self.channels.get(radar));
        if kind.is_some_and(|channel| channel.kind == Kind::Radar(RadarKind::LaserScan)) {
            self.counters.count_event("laser_scans", 1, || {
                "an experiment: a LaserScan has one return a beam, a radar many".to_owned()
            });
        }
        if are_sectors(&sweeps) {
            self.counters.count_loss("messages_are_sectors", 1, || {
                "each message has another part of a turn: merge them into whole turns first"
                    .to_owned()
            });
        }
        let mut turn = Turn::learn(&sweeps, &self.options, &mut self.counters);
        turn.is_navtech = is_navtech;
        let size_m = Some(turn.bins.resolution_m).filter(|size_m| *size_m > 0.0);
        let size_m = size_m.filter(|_| turn.sensor() == SensorKind::NavtechCts);
        self.info.bin_size = size_m.map(|size_m| {
            let points = sweeps.iter().flat_map(|sweep| &sweep.points);
            let reach_m = points.map(|point| point.range_m).fold(0.0, f64::max);
            BinSize {
                bins: (reach_m / size_m).ceil() as usize,
                // Micrometres: coordinates in single precision have no more.
                size_m: Some((size_m * 1e6).round() * 1e-6),
            }
        });
        self.info.sensor = turn.sensor();
        self.turn = Some(turn);
        Ok(())
    }

    /// Leaves out the first messages whose stamps are off.
    fn learn_stamps(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        for stream in 0..self.stamp_checks.len() {
            let of_stream = waiting.iter().filter_map(|(decoded, arrival_ns)| {
                let (found, stamp_ns) = decoded.stream()?;
                (found == stream).then_some((stamp_ns, *arrival_ns))
            });
            if let Some(check) = self.stamp_checks.get_mut(stream) {
                *check = StampCheck::new(of_stream);
            }
        }
        let good = waiting
            .into_iter()
            .filter(|(decoded, arrival_ns)| self.has_good_stamp(decoded, *arrival_ns));
        let good = good.collect();
        self.waiting = good;
    }

    /// Whether a message's stamp goes with those of its neighbours.
    pub(super) fn has_good_stamp(&mut self, decoded: &Decoded, arrival_ns: i64) -> bool {
        let Some((stream, stamp_ns)) = decoded.stream() else {
            return true;
        };
        let index = [self.radar, self.imu, self.twist]
            .get(stream)
            .copied()
            .flatten();
        let channel = index.and_then(|index| self.channels.get(index));
        let topic = channel.map_or("", |channel| channel.topic.as_str());
        let check = self.stamp_checks.get_mut(stream);
        check.is_none_or(|check| check.accepts((stamp_ns, arrival_ns), topic, &mut self.counters))
    }

    /// The bins and the time of a turn of polar images.
    fn learn_bins(&mut self) {
        let images = self
            .waiting
            .iter()
            .filter_map(|(decoded, _)| match decoded {
                Decoded::Polar(header, image) => Some((header.stamp_ns, image)),
                _ => None,
            });
        let images: Vec<_> = images.collect();
        let mut spacings: Vec<i64> = images
            .windows(2)
            .filter_map(|pair| match pair {
                [(a, _), (b, _)] => Some(b - a).filter(|ns| *ns > 0),
                _ => None,
            })
            .collect();
        spacings.sort_unstable();
        let given = self
            .options
            .period_s
            .map(|period_s| (period_s * 1e9) as i64);
        let measured = spacings.get(spacings.len() / 2).copied();
        self.period_ns = given.or(measured).unwrap_or(250_000_000);
        let bins = images.first().map(|(_, image)| image.bins());
        self.info.sensor = SensorKind::NavtechCts;
        self.bin_m = self
            .options
            .bin_size_m
            .or(self.navtech.map(|navtech| navtech.bin_m));
        self.info.bin_size = bins.map(|bins| BinSize {
            bins,
            size_m: self.bin_m.or((bins == 3768).then_some(0.0438)),
        });
        self.bin_m = self.info.bin_size.and_then(|bins| bins.size_m);
    }

    /// Finds where the sensors sit from the frames of their first messages.
    fn mount(&mut self, tree: &Tree) {
        let frame_of = |wanted: usize| {
            let mut waiting = self.waiting.iter();
            waiting.find_map(|(decoded, _)| match decoded.stream() {
                Some((stream, _)) if stream == wanted => decoded.frame(),
                _ => None,
            })
        };
        let (radar, imu) = (frame_of(0), frame_of(1));
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
}
