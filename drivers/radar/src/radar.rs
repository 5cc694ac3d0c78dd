//! A radar as the configuration says: from its socket to whole sweeps.

use crate::beam_udp::{BeamUdpDecoder, BeamUdpSocket, Listening};
use crate::condition::Condition;
use crate::navtech::{NavtechClient, NavtechDecoder};
use crate::recorder::Recorder;
use crate::{Error, Poller, RawBeam, Sink, Source, Streams, Sweep};
use randt_config::{Config, RadarSource};
use randt_device::{Count, Link};
use std::net::{Ipv4Addr, SocketAddr};
use std::os::fd::BorrowedFd;
use std::path::Path;
use std::sync::Arc;

/// A spinning radar. It is never an error that it is not there: [`Radar::link`] says so, and it is tried for ever.
///
/// ```no_run
/// let mut radar = randt_radar::Radar::new(&randt_config::Config::default())?;
/// # let now_ns = 0;
/// radar.poll(now_ns, &mut |sweep| println!("{} beams", sweep.beams()));
/// // Sleep until radar.descriptor() can be read or radar.due_ns() is there, and so on.
/// # Ok::<(), randt_radar::Error>(())
/// ```
pub struct Radar {
    poller: Arc<Poller>,
    source: Box<dyn Source>,
    streams: Streams,
    recorder: Option<Recorder>,
    condition: Condition,
}

/// Beams on their way into sweeps.
struct Joining<'a> {
    now_ns: i64,
    streams: &'a mut Streams,
    condition: &'a mut Condition,
    recorder: Option<&'a mut Recorder>,
    whole: &'a mut dyn FnMut(&Sweep),
}

impl Joining<'_> {
    fn join(&mut self, join: impl FnOnce(&mut Streams, &mut dyn FnMut(&Sweep))) {
        let (recorder, whole) = (&mut self.recorder, &mut self.whole);
        let (condition, now_ns) = (&mut self.condition, self.now_ns);
        join(self.streams, &mut |sweep| {
            // Who waits for the sweep goes first.
            whole(sweep);
            condition.came(sweep, now_ns);
            if let Some(recorder) = recorder {
                recorder.sweep(sweep);
            }
        });
    }
}

impl Sink for Joining<'_> {
    fn beam(&mut self, beam: &RawBeam) {
        self.condition.heard(self.now_ns);
        if let Some(recorder) = &mut self.recorder {
            recorder.beam(beam);
        }
        self.join(|streams, whole| streams.push(beam, whole));
    }

    fn restarted(&mut self) {
        self.join(Streams::restart);
    }
}

impl Radar {
    /// Reads section `radar`, `record.dense`, `sensor.keep_power` and `sensor.period_s`. Opens no socket yet.
    pub fn new(config: &Config) -> Result<Self, Error> {
        let poller = Arc::new(Poller::new()?);
        let silence_ns = nanoseconds(config.radar.silence_s);
        let turn_ns = nanoseconds(config.sensor.period_s);
        let condition = Condition::new(silence_ns, turn_ns);
        let keep_power = config.sensor.keep_power as f32;
        let mut recorder = None;
        let source: Box<dyn Source> = match config.radar.source {
            RadarSource::Navtech => {
                let address = reachable(&config.radar.address, "192.168.0.1:6317")?;
                let mut decoder = NavtechDecoder::new(keep_power, config.radar.byte_order);
                if !config.record.dense.is_empty() {
                    decoder.keep_all();
                    recorder = Some(Recorder::new(Path::new(&config.record.dense))?);
                }
                let poller = Arc::clone(&poller);
                Box::new(NavtechClient::new(address, silence_ns, decoder, poller))
            }
            RadarSource::BeamUdp => {
                let listening = Listening::new(
                    address(&config.radar.address, "0.0.0.0:6320")?,
                    interface(&config.radar.interface)?,
                    config.radar.receive_buffer_bytes as usize,
                )?;
                let mut decoder = BeamUdpDecoder::new(keep_power);
                decoder.pin(&config.radar);
                let poller = Arc::clone(&poller);
                Box::new(BeamUdpSocket::new(listening, silence_ns, decoder, poller))
            }
        };
        Ok(Self {
            poller,
            source,
            streams: Streams::new(turn_ns, condition.patience_ns()),
            recorder,
            condition,
        })
    }

    /// What to sleep on: the same descriptor all along.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.poller.descriptor()
    }

    /// When [`Radar::poll`] is due even if nothing comes, ns.
    pub fn due_ns(&self) -> i64 {
        self.source.due_ns().min(self.condition.due_ns())
    }

    /// Takes what has come and does what is due; hands out the sweeps that became whole. `now_ns` is of the clock that
    /// sweeps are to be stamped in.
    pub fn poll(&mut self, now_ns: i64, whole: &mut dyn FnMut(&Sweep)) {
        let mut joining = Joining {
            now_ns,
            streams: &mut self.streams,
            condition: &mut self.condition,
            recorder: self.recorder.as_mut(),
            whole,
        };
        self.source.poll(now_ns, &mut joining);
        let beams = self.source.link();
        if joining.condition.judge(now_ns, beams, joining.streams) {
            self.source.begin_anew(now_ns, &mut joining);
        }
    }

    /// How it stands to the radar: it streams when its sweeps come.
    pub fn link(&self) -> &Link {
        self.condition.link()
    }

    /// What is known of the radar, for people.
    pub fn about(&self) -> String {
        self.source.about()
    }

    /// Tells all counters.
    pub fn counts(&self, tell: &mut dyn FnMut(Count)) {
        tell(self.condition.count());
        self.source.counts(tell);
        self.streams.counts(tell);
        if let Some(recorder) = &self.recorder {
            recorder.counts(tell);
        }
    }

    /// All counters.
    pub fn counters(&self) -> Vec<Count> {
        let mut counters = Vec::new();
        self.counts(&mut |count| counters.push(count));
        counters
    }

    /// How much was lost, all that is a loss taken together.
    pub fn lost(&self) -> u64 {
        let mut lost = 0;
        self.counts(&mut |count| lost += if count.loss { count.value } else { 0 });
        lost
    }
}

fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9) as i64
}

fn address(text: &str, example: &'static str) -> Result<SocketAddr, Error> {
    text.parse().map_err(|_| Error::Address {
        address: text.to_owned(),
        example,
    })
}

/// An address of one machine: what is listened on is nobody's.
fn reachable(text: &str, example: &'static str) -> Result<SocketAddr, Error> {
    match address(text, example)? {
        address if address.ip().is_unspecified() => Err(Error::Address {
            address: text.to_owned(),
            example,
        }),
        address => Ok(address),
    }
}

fn interface(text: &str) -> Result<Ipv4Addr, Error> {
    if text.is_empty() {
        return Ok(Ipv4Addr::UNSPECIFIED);
    }
    text.parse().map_err(|_| Error::Interface {
        interface: text.to_owned(),
    })
}
