//! Sends a log's events when they are due.

use crate::output::head_only;
use randt_messages::{ImuSampleTopic, RadarScan, TwistTopic};
use randt_readers::{Event, Source};
use randt_stage::{Domain, Error, Publisher, Stage, WakeReason};
use std::time::{Duration, Instant};

/// A log that begins again does so after this pause, so that odometry opens a new frame: the robot
/// has jumped.
const PAUSE_NS: i64 = 2_000_000_000;

/// Publishes as drivers do: each event when its stamp is due, with the log's own stamps.
pub struct Player {
    domain: Domain,
    /// `None` where the shared memory is gone, until they are used again.
    ports: Option<Ports>,
    rate: f64,
    /// What is added to the log's stamps, and the newest stamp sent.
    shift_ns: i64,
    newest_ns: i64,
    begin: Option<(i64, Instant)>,
}

/// The player's place in the pipeline, and what it publishes.
struct Ports {
    scans: Publisher<RadarScan>,
    samples: Publisher<ImuSampleTopic>,
    twists: Publisher<TwistTopic>,
    stage: Stage,
}

impl Ports {
    fn open(domain: &Domain) -> Result<Self, Error> {
        let mut stage = Stage::open("play", domain)?;
        let scans = stage.publisher()?;
        let samples = stage.publisher()?;
        let twists = stage.publisher()?;
        stage.running()?;
        Ok(Self {
            scans,
            samples,
            twists,
            stage,
        })
    }
}

impl Player {
    /// Opens the sensors' topics.
    pub fn open(domain: Domain, rate: f64) -> anyhow::Result<Self> {
        Ok(Self {
            ports: Some(Ports::open(&domain)?),
            domain,
            rate,
            shift_ns: 0,
            newest_ns: i64::MIN,
            begin: None,
        })
    }

    /// Plays to the end of the source; `false` where the end was asked for before.
    pub fn play(&mut self, source: &mut dyn Source) -> anyhow::Result<bool> {
        let mut first_ns = None;
        while let Some(event) = source.next_event()? {
            let first_ns = *first_ns.get_or_insert(event.stamp_ns());
            if self.newest_ns != i64::MIN && self.shift_ns == i64::MAX {
                // Begun again: the first stamp follows the last one.
                self.shift_ns = self.newest_ns + PAUSE_NS - first_ns;
            }
            let stamp_ns = event.stamp_ns() + self.shift_ns;
            if !self.wait_until_due(stamp_ns)? {
                return Ok(false);
            }
            self.newest_ns = self.newest_ns.max(stamp_ns);
            self.publish(event)?;
        }
        Ok(true)
    }

    /// The next events are those of the log's beginning once more.
    pub fn begin_again(&mut self) {
        self.shift_ns = i64::MAX;
    }

    /// The log is at its end. With `stay` what was sent last stays in reach until the end is asked
    /// for.
    pub fn finish(&mut self, stay: bool) -> anyhow::Result<()> {
        self.ports()?.stage.finished()?;
        while stay && self.wait(None)? != WakeReason::Stop {
            // Where it has entered anew.
            self.ports()?.stage.finished()?;
        }
        Ok(())
    }

    /// The ports, opened anew where they were lost.
    fn ports(&mut self) -> Result<&mut Ports, Error> {
        let ports = match self.ports.take() {
            Some(ports) => ports,
            None => Ports::open(&self.domain)?,
        };
        Ok(self.ports.insert(ports))
    }

    /// Sleeps for a time, or without end. Where the shared memory is gone the player goes on in
    /// new memory, at the same event.
    fn wait(&mut self, pause: Option<Duration>) -> anyhow::Result<WakeReason> {
        match self.ports()?.stage.wait(&[], pause) {
            Err(error @ Error::MemoryGone { .. }) => {
                eprintln!("randt play: {error}");
                // Before it enters again: two of one name are refused.
                self.ports = None;
                Ok(WakeReason::Event)
            }
            reason => Ok(reason?),
        }
    }

    /// Leaves the pipeline.
    pub fn close(self) -> anyhow::Result<()> {
        match self.ports {
            Some(ports) => Ok(ports.stage.close()?),
            None => Ok(()),
        }
    }

    /// Sleeps until an event is due; `false` where the end was asked for.
    fn wait_until_due(&mut self, stamp_ns: i64) -> anyhow::Result<bool> {
        let (begin_ns, begin) = *self.begin.get_or_insert((stamp_ns, Instant::now()));
        let after_s = (stamp_ns - begin_ns).max(0) as f64 * 1e-9 / self.rate;
        let due = begin + Duration::from_secs_f64(after_s);
        loop {
            let pause = due.saturating_duration_since(Instant::now());
            // Also where it is late already: readers that join are served, and Ctrl-C is heard.
            match self.wait(Some(pause))? {
                WakeReason::Stop => return Ok(false),
                WakeReason::Timeout => return Ok(true),
                WakeReason::Event => {}
            }
        }
    }

    fn publish(&mut self, event: Event) -> anyhow::Result<()> {
        let shift_ns = self.shift_ns;
        match event {
            Event::Scan(mut scan) => {
                let head = &mut *scan.head;
                head.header.stamp_ns += shift_ns;
                let sweep = &mut head.sweep;
                sweep.begin_ns += shift_ns;
                sweep.end_ns += shift_ns;
                let count = (sweep.beam_count as usize).min(sweep.beams.len());
                for beam in sweep.beams.iter_mut().take(count) {
                    beam.stamp_ns += shift_ns;
                }
                self.ports()?.scans.publish(scan.as_ref())?;
            }
            Event::Imu(mut sample) => {
                sample.header.stamp_ns += shift_ns;
                sample.arrival_ns += shift_ns;
                self.ports()?.samples.publish(head_only(&sample))?;
            }
            Event::Twist(mut twist) => {
                twist.header.stamp_ns += shift_ns;
                twist.arrival_ns += shift_ns;
                self.ports()?.twists.publish(head_only(&twist))?;
            }
            // The robot does not know it either.
            Event::Truth(_) => {}
        }
        Ok(())
    }
}
