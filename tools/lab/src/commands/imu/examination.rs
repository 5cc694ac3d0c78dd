//! What an IMU recording shows, sample by sample, as a robot would learn it.
//!
//! One pass. Only the time before the first standstill profits from what comes later: its attitude
//! is computed once the bias is known.

use super::sample::Sample;
use nalgebra::Vector3;
use randt_config::Config;
use randt_evaluation::stamp_text;
use randt_filter::{AttitudeFilter, GyroBias, MountingCheck, MountingResult, Pace, Standstill};
use std::fmt::Write;

/// Intervals above this many medians are gaps: two samples lost.
const GAP_MEDIANS: f64 = 3.0;

/// A span of time in which the IMU stood, seconds after the first sample.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Span {
    /// First instant.
    pub begin_s: f64,
    /// Last instant.
    pub end_s: f64,
}

/// The state of an examination. Its fields are the filters that run on the robot, and the running
/// sums and lists of the single pass over the samples.
#[derive(Debug)]
pub struct Examination {
    attitude: AttitudeFilter,
    standstill: Standstill,
    bias: GyroBias,
    mounting: MountingCheck,
    mounting_found: Option<MountingResult>,
    /// Samples before the first standstill showed the bias; `None` afterwards.
    waiting: Option<Vec<Sample>>,
    standstills: Vec<Span>,
    first_ns: Option<i64>,
    last_ns: Option<i64>,
    stamps_ns: Vec<i64>,
    last_yaw_rate_rad_s: f64,
    heading_rad: f64,
    turned_rad: f64,
    trajectory: Option<String>,
}

/// What the stamps show.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Timing {
    /// Samples that advance the time.
    pub samples: usize,
    /// From the first to the last.
    pub duration_s: f64,
    /// One over the median interval.
    pub sample_rate_hz: f64,
    /// Shortest interval.
    pub interval_min_ms: f64,
    /// Median interval.
    pub interval_median_ms: f64,
    /// Longest interval.
    pub interval_max_ms: f64,
    /// Intervals of over three medians.
    pub gaps: usize,
}

impl Examination {
    /// Nothing seen; `keep_attitude` to write it down sample by sample.
    pub fn new(config: &Config, keep_attitude: bool) -> Self {
        Self {
            attitude: AttitudeFilter::new(&config.attitude),
            standstill: Standstill::new(&config.attitude),
            bias: GyroBias::new(
                config.odometry.gyro_bias_sigma_rad_s,
                config.odometry.gyro_bias_walk,
            ),
            mounting: MountingCheck::default(),
            mounting_found: None,
            waiting: Some(Vec::new()),
            standstills: Vec::new(),
            first_ns: None,
            last_ns: None,
            stamps_ns: Vec::new(),
            last_yaw_rate_rad_s: 0.0,
            heading_rad: 0.0,
            turned_rad: 0.0,
            trajectory: keep_attitude.then(String::new),
        }
    }

    /// Takes the next sample.
    pub fn push(&mut self, sample: Sample) {
        if self.mounting_found.is_none() {
            self.mounting_found = self
                .mounting
                .push(sample.stamp_ns, sample.acceleration_m_s2);
        }
        self.observe_standstill(&sample);
        match &mut self.waiting {
            Some(waiting) => waiting.push(sample),
            None => self.integrate(&sample),
        }
    }

    /// Ends the recording: where no standstill came, the attitude is computed without a bias.
    pub fn finish(&mut self) {
        let waiting = self.waiting.as_mut().map(core::mem::take);
        for sample in waiting.unwrap_or_default() {
            self.integrate(&sample);
        }
    }

    fn integrate(&mut self, sample: &Sample) {
        let Sample {
            stamp_ns,
            rate_rad_s,
            acceleration_m_s2,
        } = *sample;
        let pace = self.attitude.push(stamp_ns, rate_rad_s, acceleration_m_s2);
        let yaw_rate = match pace {
            Pace::Ignored => return,
            Pace::Start | Pace::Step(_) => self.attitude.yaw_rate_rad_s(rate_rad_s),
        };
        if let Pace::Step(dt_s) = pace {
            self.heading_rad += 0.5 * (self.last_yaw_rate_rad_s + yaw_rate) * dt_s;
            self.turned_rad += (rate_rad_s - self.bias.mean_rad_s()).norm() * dt_s;
        }
        self.last_yaw_rate_rad_s = yaw_rate;
        self.stamps_ns.push(stamp_ns);
        if let Some(rows) = &mut self.trajectory {
            let q = self.attitude.attitude();
            let (stamp, x, y, z, w) = (stamp_text(stamp_ns), q.x, q.y, q.z, q.w);
            // Writing to a string cannot fail.
            let _ = writeln!(rows, "{stamp} 0 0 0 {x:.9} {y:.9} {z:.9} {w:.9}");
        }
    }

    fn observe_standstill(&mut self, sample: &Sample) {
        let Sample {
            stamp_ns,
            rate_rad_s,
            acceleration_m_s2,
        } = *sample;
        let shown = self
            .standstill
            .push(stamp_ns, rate_rad_s, acceleration_m_s2);
        let elapsed_ns = stamp_ns.saturating_sub(self.last_ns.unwrap_or(stamp_ns));
        self.last_ns = Some(stamp_ns);
        self.bias.advance(elapsed_ns as f64 * 1e-9);
        if let Some(shown) = shown {
            self.bias.observe(&shown);
            self.attitude.set_bias(self.bias.mean_rad_s());
            self.finish();
            self.waiting = None;
        }
        if self.waiting.is_none() {
            self.standstill
                .expect_bias(self.bias.mean_rad_s(), self.bias.sigma_rad_s());
        }
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        let seconds = |ns: i64| ns.saturating_sub(first_ns) as f64 * 1e-9;
        let end_s = seconds(self.standstill.decided_ns());
        let Some(begin_ns) = self.standstill.still_since_ns() else {
            return;
        };
        let begin_s = seconds(begin_ns);
        match self.standstills.last_mut() {
            // The same one, or one after a doubt that was shorter than the window.
            Some(span) if (span.begin_s..=span.end_s).contains(&begin_s) => span.end_s = end_s,
            _ => self.standstills.push(Span { begin_s, end_s }),
        }
    }

    /// Sampling as the stamps show it.
    pub fn timing(&self) -> Timing {
        let (Some(&first), Some(&last)) = (self.stamps_ns.first(), self.stamps_ns.last()) else {
            return Timing::default();
        };
        // A clock that was set back begins a new series: its step is no interval.
        let pairs = self.stamps_ns.iter().zip(self.stamps_ns.iter().skip(1));
        let mut intervals: Vec<i64> = pairs
            .map(|(a, b)| b.saturating_sub(*a))
            .filter(|&ns| ns > 0)
            .collect();
        intervals.sort_unstable();
        let ms = |index: usize| intervals.get(index).map_or(0.0, |&ns| ns as f64 * 1e-6);
        let median = ms(intervals.len() / 2);
        let is_gap = |ns: &&i64| **ns as f64 * 1e-6 > GAP_MEDIANS * median;
        Timing {
            samples: self.stamps_ns.len(),
            duration_s: last.saturating_sub(first) as f64 * 1e-9,
            sample_rate_hz: if median > 0.0 { 1e3 / median } else { 0.0 },
            interval_min_ms: ms(0),
            interval_median_ms: median,
            interval_max_ms: ms(intervals.len().saturating_sub(1)),
            gaps: intervals.iter().filter(is_gap).count(),
        }
    }

    /// Where the IMU stood.
    pub fn standstills(&self) -> &[Span] {
        &self.standstills
    }

    /// The bias with its standard deviation, rad/s; `None` where no standstill showed it.
    pub fn bias_rad_s(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        self.waiting
            .is_none()
            .then(|| (self.bias.mean_rad_s(), self.bias.sigma_rad_s()))
    }

    /// How the IMU is mounted; `None` where gravity did not show.
    pub fn mounting(&self) -> Option<&MountingResult> {
        self.mounting_found.as_ref()
    }

    /// The attitude filter as it is now.
    pub fn attitude(&self) -> &AttitudeFilter {
        &self.attitude
    }

    /// How far it turned about the vertical, counter-clockwise seen from above, all turns counted.
    pub fn heading_rad(&self) -> f64 {
        self.heading_rad
    }

    /// How far it turned about any axis, back and forth added up.
    pub fn turned_rad(&self) -> f64 {
        self.turned_rad
    }

    /// Attitude as TUM rows: stamp s, position (zero), quaternion x y z w of the IMU in a level
    /// frame.
    pub fn trajectory(&self) -> Option<&str> {
        self.trajectory.as_deref()
    }
}
