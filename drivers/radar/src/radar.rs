//! A radar as it is configured: from its socket to whole sweeps.

use crate::beam_udp::{BeamUdpDecoder, BeamUdpSocket, Listening};
use crate::image_writer::ImageWriter;
use crate::navtech::{NavtechClient, NavtechDecoder};
use crate::sweep_monitor::SweepMonitor;
use crate::{BeamSink, BeamSource, Error, Poller, RawBeam, Streams, Sweep};
use randt_config::{Config, RadarSource};
use randt_device::{Count, Link};
use std::net::{Ipv4Addr, SocketAddr};
use std::os::fd::BorrowedFd;
use std::path::Path;
use std::sync::Arc;

/// A spinning radar. It is never an error that it is not there: [`Radar::link`] has the reason,
/// and it is tried without end.
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
    source: Box<dyn BeamSource>,
    streams: Streams,
    writer: Option<ImageWriter>,
    monitor: SweepMonitor,
}

/// Beams on their way into sweeps.
struct BeamRouter<'a> {
    now_ns: i64,
    streams: &'a mut Streams,
    monitor: &'a mut SweepMonitor,
    writer: Option<&'a mut ImageWriter>,
    whole: &'a mut dyn FnMut(&Sweep),
}

impl BeamRouter<'_> {
    fn join(&mut self, join: impl FnOnce(&mut Streams, &mut dyn FnMut(&Sweep))) {
        let (writer, whole) = (&mut self.writer, &mut self.whole);
        let (monitor, now_ns) = (&mut self.monitor, self.now_ns);
        join(self.streams, &mut |sweep| {
            // The sweep's consumer goes first.
            whole(sweep);
            monitor.take_sweep(sweep, now_ns);
            if let Some(writer) = writer {
                writer.sweep(sweep);
            }
        });
    }
}

impl BeamSink for BeamRouter<'_> {
    fn beam(&mut self, beam: &RawBeam) {
        self.monitor.take_beam(self.now_ns);
        if let Some(writer) = &mut self.writer {
            writer.beam(beam);
        }
        self.join(|streams, whole| streams.push(beam, whole));
    }

    fn restarted(&mut self) {
        self.join(Streams::restart);
    }
}

impl Radar {
    /// Reads section `radar`, `record.dense`, `sensor.keep_power` and `sensor.period_s`. Opens no
    /// socket yet.
    pub fn new(config: &Config) -> Result<Self, Error> {
        let poller = Arc::new(Poller::new()?);
        let silence_ns = nanoseconds(config.radar.silence_s);
        let turn_ns = nanoseconds(config.sensor.period_s);
        let monitor = SweepMonitor::new(silence_ns, turn_ns);
        let keep_power = config.sensor.keep_power as f32;
        let mut writer = None;
        let source: Box<dyn BeamSource> = match config.radar.source {
            RadarSource::Navtech => {
                let address = reachable(&config.radar.address, "192.168.0.1:6317")?;
                let mut decoder = NavtechDecoder::new(keep_power, config.radar.byte_order);
                if !config.record.dense.is_empty() {
                    decoder.keep_all();
                    writer = Some(ImageWriter::new(Path::new(&config.record.dense))?);
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
            streams: Streams::new(turn_ns, monitor.patience_ns),
            writer,
            monitor,
        })
    }

    /// What to sleep on: the same descriptor all along.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.poller.descriptor()
    }

    /// When [`Radar::poll`] is due even if nothing comes, ns.
    pub fn due_ns(&self) -> i64 {
        self.source.due_ns().min(self.monitor.due_ns())
    }

    /// Takes what has come and does what is due; hands out the sweeps that became whole. `now_ns`
    /// is of the clock that sweeps are to be stamped in.
    pub fn poll(&mut self, now_ns: i64, whole: &mut dyn FnMut(&Sweep)) {
        let mut router = BeamRouter {
            now_ns,
            streams: &mut self.streams,
            monitor: &mut self.monitor,
            writer: self.writer.as_mut(),
            whole,
        };
        self.source.poll(now_ns, &mut router);
        let beams = self.source.link();
        if router.monitor.judge(now_ns, beams, router.streams) {
            self.source.reconnect(now_ns, &mut router);
        }
    }

    /// The state of the radar's link: it streams when its sweeps come.
    pub fn link(&self) -> &Link {
        &self.monitor.link
    }

    /// Gives all counters.
    pub fn counts(&self, visit: &mut dyn FnMut(Count)) {
        visit(self.monitor.interruptions.count());
        self.source.counts(visit);
        self.streams.counts(visit);
        if let Some(writer) = &self.writer {
            writer.counts(visit);
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
    text.parse().map_err(|_| Error::address(text, example))
}

/// An address of one machine: an unspecified one is none.
fn reachable(text: &str, example: &'static str) -> Result<SocketAddr, Error> {
    let parsed = text.parse().ok();
    let reachable = parsed.filter(|address: &SocketAddr| !address.ip().is_unspecified());
    reachable.ok_or_else(|| Error::address(text, example))
}

fn interface(text: &str) -> Result<Ipv4Addr, Error> {
    if text.is_empty() {
        return Ok(Ipv4Addr::UNSPECIFIED);
    }
    text.parse().map_err(|_| Error::Interface(text.to_owned()))
}
