//! A radar as the configuration says: from its socket to whole sweeps.

use crate::beam_udp::{BeamUdpDecoder, BeamUdpSocket, Listening};
use crate::navtech::{NavtechClient, NavtechDecoder};
use crate::recorder::Recorder;
use crate::{Assembler, Error, Poller, RawBeam, Sink, Source, Sweep};
use randt_config::{Config, RadarSource};
use randt_device::{Count, Interruptions, Link};
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
    assembler: Assembler,
    recorder: Option<Recorder>,
    interruptions: Interruptions,
}

/// Beams on their way into sweeps.
struct Joining<'a> {
    assembler: &'a mut Assembler,
    recorder: Option<&'a mut Recorder>,
    whole: &'a mut dyn FnMut(&Sweep),
}

impl Joining<'_> {
    fn join(&mut self, join: impl FnOnce(&mut Assembler, &mut dyn FnMut(&Sweep))) {
        let (recorder, whole) = (&mut self.recorder, &mut self.whole);
        join(self.assembler, &mut |sweep| {
            // Who waits for the sweep goes first.
            whole(sweep);
            if let Some(recorder) = recorder {
                recorder.sweep(sweep);
            }
        });
    }
}

impl Sink for Joining<'_> {
    fn beam(&mut self, beam: &RawBeam) {
        if let Some(recorder) = &mut self.recorder {
            recorder.beam(beam);
        }
        self.join(|assembler, whole| assembler.push(beam, whole));
    }

    fn restarted(&mut self) {
        self.join(Assembler::restart);
    }
}

impl Radar {
    /// Reads section `radar`, `record.dense`, `sensor.keep_power` and `sensor.period_s`. Opens no socket yet.
    pub fn new(config: &Config) -> Result<Self, Error> {
        let poller = Arc::new(Poller::new()?);
        let silence_ns = nanoseconds(config.radar.silence_s);
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
                let decoder = BeamUdpDecoder::new(keep_power);
                let poller = Arc::clone(&poller);
                Box::new(BeamUdpSocket::new(listening, silence_ns, decoder, poller))
            }
        };
        Ok(Self {
            poller,
            source,
            assembler: Assembler::new(nanoseconds(config.sensor.period_s)),
            recorder,
            interruptions: Interruptions::default(),
        })
    }

    /// What to sleep on: the same descriptor all along.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.poller.descriptor()
    }

    /// When [`Radar::poll`] is due even if nothing comes, ns.
    pub fn due_ns(&self) -> i64 {
        self.source.due_ns()
    }

    /// Takes what has come and does what is due; hands out the sweeps that became whole. `now_ns` is of the clock that
    /// sweeps are to be stamped in.
    pub fn poll(&mut self, now_ns: i64, whole: &mut dyn FnMut(&Sweep)) {
        let mut joining = Joining {
            assembler: &mut self.assembler,
            recorder: self.recorder.as_mut(),
            whole,
        };
        self.source.poll(now_ns, &mut joining);
        self.interruptions.see(self.source.link());
    }

    /// How it stands to the radar.
    pub fn link(&self) -> &Link {
        self.source.link()
    }

    /// What is known of the radar, for people.
    pub fn about(&self) -> String {
        self.source.about()
    }

    /// Tells all counters.
    pub fn counts(&self, tell: &mut dyn FnMut(Count)) {
        tell(self.interruptions.count());
        self.source.counts(tell);
        self.assembler.counts(tell);
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
