//! An IMU as its driver knows it, without a process: readings become samples.
//!
//! Responsible for axes, stamps, order, what is lost, and for the device's link. Not responsible
//! for reaching the device: its source is.

use crate::reading_source::{ReadingSource, reading_source};
use crate::sequence::Sequence;
use crate::twists::Twists;
use crate::upright::Upright;
use crate::{Axes, Error, Reading};
use randt_config::{Config, ImuSource};
use randt_device::{Count, DeviceClock, Interruptions, Link};
use randt_messages::{ImuSample, Twist};
use std::os::fd::BorrowedFd;
use std::time::Instant;

/// An IMU, and velocities of the robot that come by lines. Its fields are the device, what is known
/// of it, and what was counted.
#[derive(Debug)]
pub struct Imu {
    source: Box<dyn ReadingSource>,
    twists: Twists,
    has_twists: bool,
    axes: SensorAxes,
    silence_ns: i64,
    clock: DeviceClock,
    sequence: Sequence,
    upright: Upright,
    readings: Vec<Reading>,
    link: Link,
    interruptions: Interruptions,
    /// When the driver began or the last sample came.
    last_ns: Option<i64>,
    stamp_ns: i64,
    counts: SampleCounts,
}

/// The axes of both sensors.
#[derive(Debug)]
struct SensorAxes {
    rate: Axes,
    acceleration: Axes,
}

/// What was counted.
#[derive(Debug, Default)]
struct SampleCounts {
    samples: u64,
    unknown: u64,
    doubled: u64,
    reconnects: u64,
}

impl Imu {
    /// One by its configuration. Nothing is opened yet; the first [`Self::poll`] does that.
    pub fn new(config: &Config) -> Result<Self, Error> {
        let imu = &config.imu;
        Ok(Self {
            source: reading_source(imu)?,
            twists: Twists::new(imu),
            has_twists: imu.source == ImuSource::Line || !imu.twist_device.is_empty(),
            axes: SensorAxes {
                rate: Axes::read_for_rates("rate_axes", &imu.rate_axes)?,
                acceleration: Axes::read("acceleration_axes", &imu.acceleration_axes)?,
            },
            silence_ns: (imu.silence_s * 1e9) as i64,
            clock: DeviceClock::default(),
            sequence: Sequence::default(),
            upright: Upright::new(&config.robot),
            readings: Vec::new(),
            link: Link::Starting,
            interruptions: Interruptions::default(),
            last_ns: None,
            stamp_ns: i64::MIN,
            counts: SampleCounts::default(),
        })
    }

    /// What to sleep on; none while nothing is open.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.source.descriptor()
    }

    /// The same of the wire that velocities have for themselves.
    pub fn twist_descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.twists.descriptor()
    }

    /// Whether velocities of the robot can come.
    pub fn has_twists(&self) -> bool {
        self.has_twists
    }

    /// The velocities that came by the last polls. Stamps rise strictly.
    pub fn drain_twists(&mut self) -> std::vec::Drain<'_, Twist> {
        self.twists.drain()
    }

    /// When to poll although nothing came; at once before the first poll.
    pub fn due_ns(&self) -> i64 {
        let Some(last_ns) = self.last_ns else {
            return i64::MIN;
        };
        let dues = [self.source.due_ns(), self.twists.due_ns()];
        let mut due_ns = dues.into_iter().flatten().min().unwrap_or(i64::MAX);
        if self.link.streams() || self.link == Link::Starting {
            due_ns = due_ns.min(last_ns.saturating_add(self.silence_ns + 1));
        }
        due_ns
    }

    /// Gives the samples that came, and does what is due. Stamps rise strictly.
    pub fn poll(&mut self, now_ns: i64, sink: &mut dyn FnMut(&ImuSample)) {
        let begin = Instant::now();
        let clock = || {
            let since_ns = i64::try_from(begin.elapsed().as_nanos()).unwrap_or_default();
            now_ns.saturating_add(since_ns)
        };
        self.poll_by(&clock, sink);
    }

    /// The same by a clock, which is read as soon as something has come. With the time from before
    /// it a program that was interrupted in between would take a sample to have arrived before it
    /// was measured.
    pub fn poll_by(&mut self, clock: &dyn Fn() -> i64, sink: &mut dyn FnMut(&ImuSample)) {
        self.last_ns.get_or_insert_with(clock);
        let mut readings = std::mem::take(&mut self.readings);
        self.source.poll(clock, &mut readings);
        self.twists.poll(self.source.as_mut(), clock);
        let now_ns = clock();
        if self.source.reconnects() != self.counts.reconnects {
            self.counts.reconnects = self.source.reconnects();
            self.sequence.restart();
            self.upright.restart();
        }
        for reading in readings.drain(..) {
            if self.sequence.is_double(&reading) {
                self.counts.doubled += 1;
            } else if reading.known() {
                let sample = self.sample(&reading);
                self.upright
                    .push(sample.header.stamp_ns, sample.acceleration_m_s2);
                sink(&sample);
                self.counts.samples += 1;
                self.last_ns = Some(now_ns);
            } else {
                self.counts.unknown += 1;
            }
        }
        self.readings = readings;
        self.judge(now_ns);
    }

    fn sample(&mut self, reading: &Reading) -> ImuSample {
        let interval_ns = self.source.interval_ns();
        self.sequence.push(reading, interval_ns);
        let stamp_ns = match reading.device_ns {
            Some(device_ns) => self.clock.host_ns(device_ns, reading.arrival_ns),
            // Readings that came at once were not measured at once.
            None => reading
                .arrival_ns
                .max(self.stamp_ns.saturating_add(interval_ns / 2)),
        };
        self.stamp_ns = stamp_ns.max(self.stamp_ns.saturating_add(1));
        let mut sample = ImuSample {
            device_ns: reading.device_ns.unwrap_or_default(),
            arrival_ns: reading.arrival_ns,
            rate_rad_s: self.axes.rate.map(reading.rate_rad_s),
            acceleration_m_s2: self.axes.acceleration.map(reading.acceleration_m_s2),
            ..ImuSample::default()
        };
        sample.header.stamp_ns = self.stamp_ns;
        sample
    }

    fn judge(&mut self, now_ns: i64) {
        let silent_ns = now_ns.saturating_sub(self.last_ns.unwrap_or(now_ns));
        self.link = if !self.source.fault().is_empty() {
            Link::Down(self.source.fault().to_owned())
        } else if silent_ns > self.silence_ns {
            let (silence, silent) = (self.source.silence(), self.silent(silent_ns));
            Link::Down(format!("{silence} for over {silent}"))
        } else if self.counts.samples == 0 {
            Link::Starting
        } else if !self.upright.complaint.is_empty() {
            Link::Warning(self.upright.complaint.clone())
        } else if !self.source.complaint().is_empty() {
            Link::Warning(self.source.complaint().to_owned())
        } else if let Some((is_hz, asked_hz)) = self.sequence.wrong_rate() {
            Link::Warning(format!(
                "{is_hz:.0} samples a second come instead of {asked_hz:.0}"
            ))
        } else if !self.twists.complaint().is_empty() {
            Link::Warning(self.twists.complaint().to_owned())
        } else {
            Link::Streaming
        };
        self.interruptions.update(&self.link);
    }

    /// The time of silence in doublings: each text that is new is a line in the journal.
    fn silent(&self, silent_ns: i64) -> String {
        let mut shown_ns = self.silence_ns.max(1);
        while shown_ns < silent_ns / 2 {
            shown_ns *= 2;
        }
        format!("{} s", shown_ns as f64 * 1e-9)
    }

    /// The device's link.
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// How much faster the device's clock is than the host's; 0 until that is known.
    pub fn skew(&self) -> f64 {
        self.clock.skew()
    }

    /// Whether gravity was measured, and points as the configured axes have it.
    pub fn is_upright(&self) -> Option<bool> {
        let is_upright = self.upright.complaint.is_empty();
        self.upright.known.then_some(is_upright)
    }

    /// Everything that was counted.
    pub fn counters(&self) -> Vec<Count> {
        let mut counts = vec![
            Count::event("samples", self.counts.samples),
            Count::loss("samples_lost", self.sequence.lost()),
            Count::event("samples_doubled", self.counts.doubled),
            Count::loss("unknown_values", self.counts.unknown),
            self.interruptions.count(),
            Count::event("reconnects", self.counts.reconnects),
            Count::event("clock_resets", self.clock.restarts()),
        ];
        counts.extend(self.source.counts());
        counts.extend(self.twists.counts());
        counts
    }

    /// Data that are missing, all together.
    pub fn lost(&self) -> u64 {
        let counters = self.counters();
        let losses = counters.iter().filter(|count| count.loss);
        losses.map(|count| count.value).sum()
    }
}
