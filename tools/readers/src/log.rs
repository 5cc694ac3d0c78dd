//! Our own MCAP log as a source.

use crate::limit::{is_instant, is_misread, no_instant};
use crate::ros2::count_damage;
use crate::summary::Summary;
use crate::sweep::repair;
use crate::{Counter, Error, Event, Extrinsics, InputInfo, InputTopic, Source, counters::Counters};
use randt_log::{Damage, LogReader};
use randt_messages::{
    DropCause, ImuSampleTopic, LogDrop, LogDropTopic, RadarScan, Topic, TruthPoseTopic, TwistTopic,
    health::text_of,
};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A log that is being read.
pub(crate) struct LogSource {
    reader: LogReader<BufReader<File>>,
    info: InputInfo,
    counters: Counters,
    counted: Vec<Damage>,
}

impl LogSource {
    pub fn open(path: &Path, radar_required: bool) -> Result<Self, Error> {
        let reader = LogReader::open(path)?;
        let robot = reader.robot()?;
        let channels = Summary::read(path).map(|summary| summary.channels());
        let topics = channels.iter().flatten();
        let topics = topics.map(|(name, type_name, _, messages)| InputTopic {
            used_as: match name.as_str() {
                RadarScan::NAME => Some("radar"),
                ImuSampleTopic::NAME => Some("imu"),
                TwistTopic::NAME => Some("twist"),
                TruthPoseTopic::NAME => Some("truth"),
                _ => None,
            },
            name: name.clone(),
            type_name: type_name.clone(),
            messages: *messages,
        });
        let topics = topics.collect();
        let scans = channels.map(|channels| {
            let channels = channels.iter();
            let radar = channels.filter(|(topic, ..)| topic == RadarScan::NAME);
            radar.map(|(.., messages)| messages).sum()
        });
        if scans == Some(0) && radar_required {
            return Err(Error::NoRadar {
                path: path.display().to_string(),
                topics: format!("no message of {}", RadarScan::NAME),
            });
        }
        Ok(Self {
            info: InputInfo {
                format: "randt-log",
                sensor: robot.sensor,
                scans,
                configuration: reader.configuration().map(str::to_owned),
                extrinsics: robot.into(),
                bin_size: None,
                without_intensity: None,
                topics,
            },
            reader,
            counters: Counters::default(),
            counted: Vec::new(),
        })
    }

    /// Metadata behind the messages come too late for the messages before them.
    fn judge_late_metadata(&mut self) -> Result<(), Error> {
        let configuration = self.reader.configuration().map(str::to_owned);
        let robot = Extrinsics::from(self.reader.robot()?);
        if robot != self.info.extrinsics || configuration != self.info.configuration {
            self.counters.count_loss("metadata_too_late", 1, || {
                "robot or configuration stand behind the first message, where no reader has them in time; \
                 `randt run --robot FILE --profile FILE` sets them"
                    .to_owned()
            });
        }
        Ok(())
    }

    /// The next message of a topic that matters; `Err` inside where it is not what its topic
    /// should hold.
    fn step(&mut self) -> Result<Step, Error> {
        let Some(entry) = self.reader.next_entry()? else {
            return Ok(Step::End);
        };
        let topic = entry.channel.topic.as_str();
        let event = if topic == RadarScan::NAME {
            let scan = entry.decode::<RadarScan>();
            scan.map(|scan| scan.map(Event::Scan))
        } else if topic == ImuSampleTopic::NAME {
            let sample = entry.decode::<ImuSampleTopic>();
            sample.map(|sample| sample.map(|s| Event::Imu(*s.head)))
        } else if topic == TwistTopic::NAME {
            let twist = entry.decode::<TwistTopic>();
            twist.map(|twist| twist.map(|t| Event::Twist(*t.head)))
        } else if topic == TruthPoseTopic::NAME {
            let pose = entry.decode::<TruthPoseTopic>();
            pose.map(|pose| pose.map(|p| Event::Truth(*p.head)))
        } else if let Ok(Some(drop)) = entry.decode::<LogDropTopic>() {
            return Ok(Step::NotRecorded(*drop.head));
        } else {
            return Ok(Step::Other);
        };
        match event {
            Ok(Some(event)) => Ok(Step::Event(event)),
            Ok(None) => Ok(Step::Other),
            Err(error @ randt_log::Error::MessageSize { .. }) => {
                Ok(Step::Malformed(error.to_string()))
            }
            Err(error) => Err(error.into()),
        }
    }
}

enum Step {
    Event(Event),
    Malformed(String),
    /// Messages that the recorder of the log missed.
    NotRecorded(LogDrop),
    Other,
    End,
}

impl Source for LogSource {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        loop {
            let step = self.step()?;
            count_damage(self.reader.damage(), &mut self.counted, &mut self.counters);
            match step {
                Step::End => {
                    self.judge_late_metadata()?;
                    let translated: Vec<String> = self.reader.translated().collect();
                    let (name, count) = ("topics_of_another_build", translated.len() as u64);
                    self.counters
                        .count_event(name, count, || translated.join("; "));
                    return Ok(None);
                }
                Step::Other => {}
                Step::NotRecorded(drop) => {
                    let (count, topic) = (drop.count, text_of(&drop.topic));
                    let cause = DropCause::from_code(drop.cause).name();
                    let first = || format!("{count} of {topic}: {cause}");
                    self.counters
                        .count_loss("messages_not_recorded", count, first);
                }
                Step::Malformed(why) => self.counters.count_loss("messages_malformed", 1, || why),
                Step::Event(event) if !is_instant(event.stamp_ns()) => {
                    let why = || no_instant(event.stamp_ns());
                    self.counters.count_loss("messages_malformed", 1, why);
                }
                Step::Event(Event::Scan(mut scan)) => {
                    if repair(&mut scan, &mut self.counters) {
                        return Ok(Some(Event::Scan(scan)));
                    }
                }
                Step::Event(Event::Imu(sample)) => {
                    let (rate, acceleration) = (&sample.rate_rad_s, &sample.acceleration_m_s2);
                    let stamp_ns = sample.header.stamp_ns;
                    if !is_misread(&mut self.counters, stamp_ns, rate, acceleration) {
                        return Ok(Some(Event::Imu(sample)));
                    }
                }
                Step::Event(event) => return Ok(Some(event)),
            }
        }
    }

    fn counters(&self) -> Vec<Counter> {
        self.counters.list()
    }
}
