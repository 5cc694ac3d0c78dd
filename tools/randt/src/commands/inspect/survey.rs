//! One pass over an input: rates, gaps, ranges, gravity.

use super::check_interrupt;
use crate::units::count;
use randt_config::{Config, Error, SelectionArguments};
use randt_filter::check_sweep;
use randt_messages::{ImuSample, Message, RadarScan, SweepHead};
use randt_readers::{Event, InputInfo, Source};
use serde::Serialize;

/// Stands in for the width of a range bin that nobody knows, for the picture only.
pub const SIZE_ASSUMED_M: f64 = 0.05;

/// Most scans from which ranges are gathered, and most returns of one: enough for quantiles.
const SCANS_SAMPLED: usize = 4000;
const RETURNS_SAMPLED: usize = 40;
/// Most points of a scan in the picture.
const SKETCH_POINTS: usize = 4000;
/// Reach of returns, m, to which the room is one of a building, and from which it is a landscape.
const INDOOR_M: f64 = 14.0;
const OUTDOOR_M: f64 = 50.0;

/// A scan for the picture: seconds since the first, and points, m.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    pub after_s: f64,
    pub points_m: Vec<[f32; 2]>,
}

/// What one pass found. Its fields are figures of the two streams.
#[derive(Debug, Default, Serialize)]
pub struct Survey {
    pub sweeps: u64,
    pub empty_sweeps: u64,
    pub duration_s: f64,
    pub sweep_hz: Option<f64>,
    /// Longer than twice the usual spacing.
    pub sweep_gaps: u64,
    pub longest_gap_s: f64,
    /// Sweeps that are not after the one before.
    pub steps_back: u64,
    pub beams: u32,
    pub clockwise: bool,
    pub returns_median: Option<f64>,
    /// Median and 95 % quantile of the returns' ranges, m.
    pub range_median_m: Option<f64>,
    pub reach_m: Option<f64>,
    pub intensity_median: Option<f64>,
    #[serde(skip)]
    pub range_resolution_m: Option<f64>,
    /// The first sweep's head.
    #[serde(skip)]
    pub first: Option<Box<SweepHead>>,
    pub imu_samples: u64,
    pub imu_hz: Option<f64>,
    /// Longer than 50 ms.
    pub imu_gaps: u64,
    pub longest_imu_gap_s: f64,
    /// Sweeps whose whole turn lies within the IMU's samples.
    pub sweeps_with_imu: u64,
    /// Mean specific force, m/s^2, and the largest rate, rad/s.
    pub mean_force_m_s2: [f64; 3],
    pub largest_rate_rad_s: f64,
    pub twists: u64,
    pub truths: u64,
    #[serde(skip)]
    pub sketches: Vec<Sketch>,
}

/// A pause of the IMU longer than this is a gap, ns: 12 samples at 250 Hz.
const IMU_GAP_NS: i64 = 50_000_000;

/// Keys that an input may differ in; more would be the same ones again.
const SETTINGS_MAX: usize = 2;

impl Survey {
    /// Reads an input to its end.
    pub fn read(source: &mut dyn Source) -> anyhow::Result<Self> {
        let mut survey = Self::default();
        let (mut spacings, mut counts) = (Vec::new(), Vec::new());
        let (mut ranges, mut intensities) = (Vec::new(), Vec::new());
        let (mut sweeps_ns, mut imu_spacings) = (Vec::new(), Vec::new());
        let (mut imu_ns, mut force) = (Vec::<i64>::new(), [0.0; 3]);
        let expected = source.info().scans.unwrap_or(400);
        while let Some(event) = source.next_event()? {
            check_interrupt()?;
            match event {
                Event::Scan(scan) => {
                    let sweep = &scan.head.sweep;
                    if let Some((_, last_ns)) = sweeps_ns.last() {
                        spacings.push(sweep.end_ns - last_ns);
                    }
                    sweeps_ns.push((sweep.begin_ns, sweep.end_ns));
                    if [1, 2, 3]
                        .iter()
                        .any(|quarter| survey.sweeps == expected * quarter / 4)
                    {
                        let begin_ns = sweeps_ns.first().map_or(0, |(_, end_ns)| *end_ns);
                        survey.sketches.push(sketch(&scan, sweep.end_ns - begin_ns));
                    }
                    survey.take_sweep(&scan);
                    if counts.len() < SCANS_SAMPLED {
                        let every = scan.items.len().div_ceil(RETURNS_SAMPLED).max(1);
                        let some = scan.items.iter().step_by(every);
                        ranges.extend(some.clone().map(|item| f64::from(item.range_m)));
                        intensities.extend(some.map(|item| f64::from(item.intensity)));
                        counts.push(scan.items.len() as f64);
                    }
                }
                Event::Imu(sample) => {
                    let stamp_ns = sample.header.stamp_ns;
                    imu_spacings.extend(imu_ns.last().map(|last_ns| stamp_ns - last_ns));
                    imu_ns.push(stamp_ns);
                    survey.take_sample(&sample, &mut force);
                }
                Event::Twist(_) => survey.twists += 1,
                Event::Truth(_) => survey.truths += 1,
            }
        }
        let usual_ns = quantile(
            &mut spacings.iter().map(|ns| *ns as f64).collect::<Vec<_>>(),
            0.5,
        );
        survey.sweep_hz = usual_ns.filter(|ns| *ns > 0.0).map(|ns| 1e9 / ns);
        for spacing_ns in &spacings {
            let is_gap = usual_ns.is_some_and(|usual| *spacing_ns as f64 > 2.0 * usual);
            survey.sweep_gaps += u64::from(is_gap);
            survey.steps_back += u64::from(*spacing_ns <= 0);
            survey.longest_gap_s = survey.longest_gap_s.max(*spacing_ns as f64 * 1e-9);
        }
        if let (Some((_, first)), Some((_, last))) = (sweeps_ns.first(), sweeps_ns.last()) {
            survey.duration_s = (last - first) as f64 * 1e-9;
        }
        survey.returns_median = quantile(&mut counts, 0.5);
        survey.range_median_m = quantile(&mut ranges, 0.5);
        survey.reach_m = quantile(&mut ranges, 0.95);
        survey.intensity_median = quantile(&mut intensities, 0.5);
        let usual_ns = quantile(
            &mut imu_spacings.iter().map(|ns| *ns as f64).collect::<Vec<_>>(),
            0.5,
        );
        survey.imu_hz = usual_ns.filter(|ns| *ns > 0.0).map(|ns| 1e9 / ns);
        for spacing_ns in imu_spacings {
            survey.imu_gaps += u64::from(spacing_ns > IMU_GAP_NS);
            survey.longest_imu_gap_s = survey.longest_imu_gap_s.max(spacing_ns as f64 * 1e-9);
        }
        survey.mean_force_m_s2 = force.map(|sum: f64| sum / imu_ns.len().max(1) as f64);
        imu_ns.sort_unstable();
        let is_covered = |(begin_ns, end_ns): &&(i64, i64)| {
            let from = imu_ns.partition_point(|ns| ns < begin_ns);
            let to = imu_ns.partition_point(|ns| ns < end_ns);
            from > 0 && to < imu_ns.len() && from < to
        };
        survey.sweeps_with_imu = sweeps_ns.iter().filter(is_covered).count() as u64;
        Ok(survey)
    }

    fn take_sweep(&mut self, scan: &Message<RadarScan>) {
        let sweep = &scan.head.sweep;
        self.sweeps += 1;
        self.first.get_or_insert_with(|| Box::new(*sweep));
        self.empty_sweeps += u64::from(scan.items.is_empty());
        self.beams = self.beams.max(sweep.beam_count);
        if let [first, second, ..] = sweep.beams() {
            let step_rad = randt_geometry::elementary::wrap(
                f64::from(second.azimuth_rad) - f64::from(first.azimuth_rad),
            );
            self.clockwise = step_rad < 0.0;
        }
        let size_m = f64::from(sweep.range_resolution_m);
        // Single precision has no more.
        let rounded_m = (size_m * 1e6).round() * 1e-6;
        self.range_resolution_m = (size_m > 0.0).then_some(rounded_m);
    }

    fn take_sample(&mut self, sample: &ImuSample, force: &mut [f64; 3]) {
        self.imu_samples += 1;
        for (sum, value) in force.iter_mut().zip(sample.acceleration_m_s2) {
            *sum += value;
        }
        let [x, y, z] = sample.rate_rad_s;
        let rate_rad_s = (x * x + y * y + z * z).sqrt();
        self.largest_rate_rad_s = self.largest_rate_rad_s.max(rate_rad_s);
    }

    /// The option that chooses the environment, by how far returns come from.
    pub fn profile(&self) -> &'static str {
        match self.reach_m {
            Some(reach_m) if reach_m <= INDOOR_M => " --profile indoor",
            Some(reach_m) if reach_m >= OUTDOOR_M && self.imu_samples == 0 => " --profile oxford",
            Some(reach_m) if reach_m >= OUTDOOR_M => " --profile outdoor",
            _ => "",
        }
    }

    /// The sensor whose returns come from as far, where the input names none, nobody has chosen one
    /// and the one that is taken otherwise sees less far.
    pub fn other_sensor(
        &self,
        selection: &SelectionArguments,
        info: &InputInfo,
        config: Option<&Config>,
    ) -> Option<&'static str> {
        let is_chosen = info.sensor.name().is_some()
            || info.configuration.is_some()
            || selection
                .as_arguments()
                .iter()
                .any(|option| option.starts_with("--sensor"));
        let reaches_farther =
            config.is_some_and(|config| self.reach_m > Some(config.sensor.range_max_m));
        (!is_chosen && reaches_farther).then_some("navtech-cts")
    }

    /// The keys without which the configured radar is another one than the input's.
    pub fn settings(&self, mut config: Config) -> impl Iterator<Item = String> {
        let mut settings = Vec::new();
        while let Some(sweep) = &self.first
            && let Err(Error::SensorMismatch { key, found, .. }) = check_sweep(sweep, &config)
        {
            match key {
                "azimuth_step_rad" => config.sensor.azimuth_step_rad = found,
                "range_resolution_m" => config.sensor.range_resolution_m = found,
                _ => break,
            }
            settings.push(format!("sensor.{key}={found}"));
            if settings.len() > SETTINGS_MAX {
                break;
            }
        }
        settings.into_iter()
    }

    /// The radar in a line.
    pub fn radar_text(&self, size_m: Option<f64>, bins: Option<usize>) -> String {
        let mut text = format!(
            "{} in {:.1} s, {:.2} Hz, {} beams {}, {:.0} returns a sweep, half within {:.1} m, 95 % within {:.1} m",
            count(self.sweeps, "sweep", "sweeps"),
            self.duration_s,
            self.sweep_hz.unwrap_or_default(),
            self.beams,
            if self.clockwise {
                "clockwise"
            } else {
                "counter-clockwise"
            },
            self.returns_median.unwrap_or_default(),
            self.range_median_m.unwrap_or_default(),
            self.reach_m.unwrap_or_default(),
        );
        match (bins, size_m) {
            (Some(bins), Some(size_m)) => text += &format!(", {bins} bins of {size_m:.4} m"),
            (Some(bins), None) => text += &format!(", {bins} bins of unknown width"),
            (None, Some(size_m)) => text += &format!(", bins of {size_m:.4} m"),
            (None, None) => {}
        }
        text
    }

    /// The IMU in a line.
    pub fn imu_text(&self) -> String {
        if self.imu_samples == 0 {
            return "none: the heading comes from the radar alone".to_owned();
        }
        let [x, y, z] = self.mean_force_m_s2;
        format!(
            "{}, {:.0} Hz, covers {} of {}, mean specific force {x:.2} {y:.2} {z:.2} m/s2, up to {:.1} deg/s",
            count(self.imu_samples, "sample", "samples"),
            self.imu_hz.unwrap_or_default(),
            self.sweeps_with_imu,
            count(self.sweeps, "sweep", "sweeps"),
            self.largest_rate_rad_s.to_degrees()
        )
    }
}

fn sketch(scan: &Message<RadarScan>, after_ns: i64) -> Sketch {
    let every = scan.items.len().div_ceil(SKETCH_POINTS).max(1);
    let beams = scan.head.sweep.beams();
    let points = scan.items.iter().step_by(every).filter_map(|item| {
        let azimuth_rad = beams.get(usize::from(item.beam))?.azimuth_rad;
        let (sin, cos) = randt_geometry::elementary::sin_cos(azimuth_rad.into());
        Some([item.range_m * cos as f32, item.range_m * sin as f32])
    });
    Sketch {
        after_s: after_ns as f64 * 1e-9,
        points_m: points.collect(),
    }
}

/// The value at a fraction of a list.
fn quantile(values: &mut [f64], fraction: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values
        .get((values.len() as f64 * fraction) as usize)
        .copied()
}
