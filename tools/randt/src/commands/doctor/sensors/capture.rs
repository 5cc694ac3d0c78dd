//! What the sensors send, seen for some seconds: by way of a driver that runs, else by one of our
//! own.

use super::estimate::LiveEstimate;
use super::turning::Panorama;
use crate::commands::doctor::finding::Finding;
use randt_config::Config;
use randt_device::{Count, Link};
use randt_imu::Imu;
use randt_messages::{
    ImuSample, ImuSampleTopic, Message, MessageRef, RadarScan, Return, ScanHead, SensorKind,
    StageHealth, StageHealthTopic, SweepHead, Twist, TwistTopic, health::text_of,
};
use randt_radar::Radar;
use randt_stage::{Clock, Domain, Observer, Registry, Subscriber};
use std::time::{Duration, Instant};

/// Between two looks: a tenth of the shortest silence that counts.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// One sensor, as far as it was seen.
#[derive(Debug)]
pub struct Seen<T> {
    /// Whether its driver runs, and was asked instead.
    pub through_driver: bool,
    /// The driver's own report.
    pub link: Link,
    /// What the driver has counted; through a running one only what it has lost.
    pub counts: Vec<Count>,
    /// What came, with the time when it did, ns.
    pub came: Vec<(i64, T)>,
}

impl<T> Default for Seen<T> {
    fn default() -> Self {
        Self {
            through_driver: false,
            link: Link::Starting,
            counts: Vec::new(),
            came: Vec::new(),
        }
    }
}

impl<T> Seen<T> {
    /// Whether it is reached; `come` is the text about what comes from where, `fix` what helps
    /// where nothing does.
    pub fn reached(&self, about: &'static str, come: &str, fix: &str) -> Finding {
        let way = match self.through_driver {
            true => format!("randt-{about} runs: "),
            false => String::new(),
        };
        let counts = self.counts.iter().filter(|count| count.value > 0);
        let counted: Vec<String> = counts
            .map(|count| format!("{} {}", count.name.replace('_', " "), count.value))
            .collect();
        let counted = match counted.as_slice() {
            [] => String::new(),
            counted => format!(" ({})", counted.join(", ")),
        };
        match &self.link {
            Link::Streaming => Finding::ok(about, format!("{way}{come}{counted}")),
            Link::Warning(text) => Finding::warn(about, format!("{way}{text}{counted}"), fix),
            Link::Starting => Finding::bad(about, format!("{way}nothing came{counted}"), fix),
            Link::Down(text) => Finding::bad(about, format!("{way}{text}{counted}"), fix),
        }
    }

    /// Takes what a driver that runs reports of itself.
    fn hear(&mut self, now_ns: i64, word: &StageHealth) {
        if !self.through_driver {
            return;
        }
        let last = self.came.last();
        let is_silent = last.is_none_or(|(at_ns, _)| now_ns - at_ns > 1_000_000_000);
        self.link = match text_of(&word.message) {
            "" => Link::Streaming,
            text if is_silent => Link::Down(text.to_owned()),
            text => Link::Warning(text.to_owned()),
        };
        self.counts = vec![Count::loss("lost since it started", word.lost)];
    }
}

/// A sweep, without its returns.
#[derive(Debug)]
pub struct Sweep {
    pub head: Box<SweepHead>,
    pub returns: usize,
    pub panorama: Panorama,
}

/// Both sensors, the robot's velocity where it has one, and what odometry makes of them.
pub struct Both {
    pub radar: Seen<Sweep>,
    pub imu: Option<Seen<ImuSample>>,
    pub twists: Vec<Twist>,
    pub estimate: LiveEstimate,
}

impl Both {
    fn take_scan(&mut self, now_ns: i64, scan: MessageRef<'_, RadarScan>) {
        self.radar.take(now_ns, scan);
        self.estimate.push_scan(scan);
    }

    fn take_sample(&mut self, now_ns: i64, sample: &ImuSample) {
        if let Some(of_imu) = &mut self.imu {
            of_imu.came.push((now_ns, *sample));
        }
        self.estimate.push_imu(sample);
    }

    fn take_twist(&mut self, twist: &Twist) {
        self.twists.push(*twist);
        self.estimate.push_twist(twist);
    }
}

impl Seen<Sweep> {
    fn take(&mut self, now_ns: i64, scan: MessageRef<'_, RadarScan>) {
        let sweep = Sweep {
            head: Box::new(scan.head.sweep),
            returns: scan.items.len(),
            panorama: Panorama::from_scan(scan),
        };
        self.came.push((now_ns, sweep));
    }
}

/// Captures for this time, or until Ctrl-C.
pub fn capture(
    config: &Config,
    domain: &Domain,
    time: Duration,
    use_imu: bool,
) -> anyhow::Result<Both> {
    let register = Registry::all(domain);
    let lives = |name: &str| register.iter().any(|(it, lives)| *lives && it.name == name);
    let mut seen = Both {
        radar: Seen::default(),
        imu: use_imu.then(Seen::default),
        twists: Vec::new(),
        estimate: LiveEstimate::new(config, use_imu),
    };
    let mut bus = Bus::default();
    if lives("radar") || lives("imu") {
        bus = Bus::open(domain, lives("radar"), use_imu && lives("imu"))?;
    }
    // Without a pipeline there may be no folder for its clock.
    let clock = Clock::in_domain(domain).unwrap_or_else(|_| Clock::alone());
    let radar = bus.scans.is_none().then(|| Radar::new(config));
    let mut radar = radar.transpose()?;
    let imu = (use_imu && bus.samples.is_none()).then(|| Imu::new(config));
    let mut imu = imu.transpose()?;
    seen.radar.through_driver = radar.is_none();
    if let Some(of_imu) = &mut seen.imu {
        of_imu.through_driver = imu.is_none();
    }
    crate::job::catch_interrupts();
    let end = Instant::now() + time;
    let mut scan = Message::<RadarScan>::default();
    while Instant::now() < end && !crate::job::interrupted() {
        let now_ns = clock.now_ns();
        if let Some(radar) = &mut radar {
            let sensor = SensorKind::from_name(&config.sensor.name);
            radar.poll(now_ns, &mut |sweep| {
                *scan.head = ScanHead::default();
                scan.items.clear();
                scan.items.resize(sweep.len(), Return::default());
                sweep.write_head(sensor, &mut scan.head);
                sweep.write_items(&mut scan.items);
                seen.take_scan(now_ns, scan.as_ref());
            });
        }
        if let Some(imu) = &mut imu {
            imu.poll(now_ns, &mut |sample| seen.take_sample(now_ns, sample));
            for twist in imu.drain_twists() {
                seen.take_twist(&twist);
            }
        }
        bus.read(now_ns, &mut seen)?;
        std::thread::sleep(POLL_PERIOD);
    }
    if let Some(radar) = radar {
        (seen.radar.link, seen.radar.counts) = (radar.link().clone(), radar.counters());
    }
    if let (Some(imu), Some(of_imu)) = (imu, &mut seen.imu) {
        (of_imu.link, of_imu.counts) = (imu.link().clone(), imu.counters());
    }
    Ok(seen)
}

/// Drivers that run, and what they publish.
#[derive(Default)]
struct Bus {
    scans: Option<Subscriber<RadarScan>>,
    samples: Option<Subscriber<ImuSampleTopic>>,
    twists: Option<Subscriber<TwistTopic>>,
    health: Option<Subscriber<StageHealthTopic>>,
    /// When this began: what was sent before is history.
    begin_ns: i64,
    // The ports' node goes after them.
    observer: Option<Observer>,
}

impl Bus {
    fn open(domain: &Domain, radar: bool, imu: bool) -> anyhow::Result<Self> {
        let Some(observer) = Observer::enter(domain)? else {
            return Ok(Self::default());
        };
        Ok(Self {
            scans: radar.then(|| observer.subscriber()).transpose()?,
            samples: imu.then(|| observer.subscriber()).transpose()?,
            twists: imu.then(|| observer.subscriber()).transpose()?,
            health: Some(observer.subscriber()?),
            begin_ns: observer.clock().now_ns(),
            observer: Some(observer),
        })
    }

    fn read(&mut self, now_ns: i64, seen: &mut Both) -> anyhow::Result<()> {
        let Some(observer) = &self.observer else {
            return Ok(());
        };
        let begin_ns = self.begin_ns;
        if let Some(scans) = &mut self.scans {
            observer.read(scans, |scan| {
                let published_ns = scan.header().published_ns;
                if published_ns > begin_ns {
                    seen.take_scan(published_ns, scan);
                }
            })?;
        }
        if let Some(samples) = &mut self.samples {
            observer.read(samples, |sample| {
                let published_ns = sample.header().published_ns;
                if published_ns > begin_ns {
                    seen.take_sample(published_ns, sample.head);
                }
            })?;
        }
        if let Some(twists) = &mut self.twists {
            observer.read(twists, |twist| {
                if twist.header().published_ns > begin_ns {
                    seen.take_twist(twist.head);
                }
            })?;
        }
        if let Some(health) = &mut self.health {
            observer.read(health, |word| {
                match (text_of(&word.head.name), &mut seen.imu) {
                    ("radar", _) => seen.radar.hear(now_ns, word.head),
                    ("imu", Some(of_imu)) => of_imu.hear(now_ns, word.head),
                    _ => {}
                }
            })?;
        }
        Ok(())
    }
}
