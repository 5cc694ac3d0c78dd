//! A Navtech's stream of bytes to beams.

use super::configuration::Configuration;
use super::fft::Fft;
use super::frame::{Frame, FrameParser, VERSION, kind};
use super::order::Stamps;
use crate::counters::counters;
use crate::{BeamDecoder, BeamLayout, BeamPosition, RawBeam};
use randt_config::ByteOrder;
use randt_device::Count;
use randt_messages::MAX_BEAMS;

counters! {
    /// Messages, and what happened to them.
    struct Counters {
        messages: event "messages",
        keep_alives: event "keep_alives",
        health: event "health_messages",
        unknown: event "messages_unknown",
        damaged: event "messages_damaged",
        contradicted: event "configurations_contradicted",
        unconfigured: event "beams_before_configuration",
        junk_bytes: event "junk_bytes",
        versions: event "messages_of_unknown_version",
        oversize: event "messages_oversize",
    }
}

/// Colossus to beams; remembers the configuration that the radar sends on connecting.
pub struct NavtechDecoder {
    parser: FrameParser,
    state: State,
}

/// What is beside the parser, which lends its frames.
struct State {
    keep_power: f32,
    stamps: Stamps,
    configuration: Option<Configuration>,
    configurations: u64,
    /// One that contradicts it, until the radar sends it once more.
    doubted: Option<Configuration>,
    version: u8,
    beam: RawBeam,
    counters: Counters,
    dense: bool,
}

impl NavtechDecoder {
    /// Echoes must be above `keep_power`, in 0.5 dB.
    pub fn new(keep_power: f32, byte_order: ByteOrder) -> Self {
        Self {
            parser: FrameParser::default(),
            state: State {
                keep_power,
                stamps: Stamps::new(byte_order),
                configuration: None,
                configurations: 0,
                doubted: None,
                version: VERSION,
                beam: RawBeam::default(),
                counters: Counters::default(),
                dense: false,
            },
        }
    }

    /// Beams have all their powers too.
    pub fn keep_all(&mut self) {
        self.state.dense = true;
    }

    /// The radar's configuration in this connection.
    pub fn configuration(&self) -> Option<&Configuration> {
        self.state.configuration.as_ref()
    }

    /// How many configurations came in all: the radar begins anew with one.
    pub fn configurations(&self) -> u64 {
        self.state.configurations
    }

    /// How many configurations contradicted the one in force: each is to be asked for once more.
    pub fn doubts(&self) -> u64 {
        self.state.counters.contradicted
    }

    /// The version of the radar's last message, which it is answered in.
    pub fn version(&self) -> u8 {
        self.state.version
    }
}

impl BeamDecoder for NavtechDecoder {
    fn decode(&mut self, bytes: &[u8], arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        self.parser.push(bytes);
        while let Some(frame) = self.parser.next() {
            self.state.take(frame, arrival_ns, beams);
        }
    }

    fn restart(&mut self) {
        self.parser.restart();
        self.state.stamps.restart();
        (self.state.configuration, self.state.doubted) = (None, None);
        self.state.version = VERSION;
    }

    fn counts(&self, visit: &mut dyn FnMut(Count)) {
        let faults = self.parser.faults();
        let counters = Counters {
            damaged: self.state.counters.damaged + faults.cut,
            junk_bytes: faults.junk_bytes,
            versions: faults.versions,
            oversize: faults.oversize,
            ..self.state.counters
        };
        counters.visit(visit);
    }
}

impl State {
    fn take(&mut self, frame: Frame<'_>, arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        self.counters.messages += 1;
        self.version = frame.version;
        match frame.kind {
            kind::CONFIGURATION => match Configuration::decode(frame.payload) {
                Some(configuration) if (3..=MAX_BEAMS as u16).contains(&configuration.azimuths) => {
                    self.configure(configuration);
                }
                _ => self.counters.damaged += 1,
            },
            kind::FFT_8 | kind::FFT_16 => self.take_beam(&frame, arrival_ns, beams),
            kind::KEEP_ALIVE => self.counters.keep_alives += 1,
            kind::HEALTH => self.counters.health += 1,
            _ => self.counters.unknown += 1,
        }
    }

    /// In a connection a radar changes its configuration rarely, and one wrong message would make
    /// all beams wrong that follow: another one counts when it comes twice.
    fn configure(&mut self, configuration: Configuration) {
        let is_other = self
            .configuration
            .as_ref()
            .is_some_and(|current| *current != configuration);
        if is_other && self.doubted.as_ref() != Some(&configuration) {
            self.doubted = Some(configuration);
            self.counters.contradicted += 1;
            return;
        }
        self.doubted = None;
        self.configuration = Some(configuration);
        self.configurations += 1;
    }

    fn take_beam(&mut self, frame: &Frame<'_>, arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        let Some(configuration) = &self.configuration else {
            self.counters.unconfigured += 1;
            return;
        };
        let fft = Fft::decode(frame.payload, frame.kind == kind::FFT_16)
            .filter(|fft| fft.azimuth < configuration.encoder_size);
        let Some(fft) = fft else {
            self.counters.damaged += 1;
            return;
        };
        let beam = &mut self.beam;
        beam.position = BeamPosition::Running(fft.counter);
        beam.azimuth = fraction(fft.azimuth, configuration.encoder_size);
        beam.device_ns = self.stamps.read(fft.time);
        beam.arrival_ns = arrival_ns;
        beam.layout = layout(configuration);
        beam.echoes.clear();
        beam.dropped = fft.bins.above(self.keep_power, &mut beam.echoes);
        beam.powers.clear();
        if self.dense {
            fft.bins.all(&mut beam.powers);
        }
        beams(beam);
    }
}

/// Counts of an encoder as a fraction of a turn; 2^32 are one.
fn fraction(counts: u16, encoder_size: u16) -> u32 {
    ((u64::from(counts) << 32) / u64::from(encoder_size.max(1))) as u32
}

/// Navtechs turn and count clockwise; a range is that of its bin's middle.
fn layout(configuration: &Configuration) -> BeamLayout {
    let bin_m = configuration.bin_m() * f64::from(configuration.range_gain);
    let mhz = i64::from(configuration.rotation_mhz);
    BeamLayout {
        beams: configuration.azimuths,
        clockwise: true,
        bin_m,
        first_m: 0.5 * bin_m + f64::from(configuration.range_offset_m),
        turn_ns: (mhz > 0).then(|| 1_000_000_000_000 / mhz),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::navtech::configuration::Details;

    fn message(azimuths: u16, range_gain: f32) -> Vec<u8> {
        let configuration = Configuration {
            azimuths,
            bin_size_01mm: 438,
            bins: 3768,
            encoder_size: 5600,
            rotation_mhz: 4000,
            packets_per_s: 1600,
            range_gain,
            range_offset_m: 0.0,
            details: Details::default(),
        };
        let (mut payload, mut bytes) = (Vec::new(), Vec::new());
        configuration.encode(&mut payload);
        Frame {
            version: 1,
            kind: kind::CONFIGURATION,
            payload: &payload,
        }
        .encode(&mut bytes);
        bytes
    }

    #[test]
    fn one_wrong_configuration_is_asked_for_once_more() {
        let mut decoder = NavtechDecoder::new(0.0, ByteOrder::Auto);
        let mut come = |bytes: &[u8]| {
            decoder.decode(bytes, 0, &mut |_| {});
            let azimuths = decoder.configuration().map(|known| known.azimuths);
            (azimuths, decoder.configurations(), decoder.doubts())
        };
        assert_eq!(come(&message(400, 1.0)), (Some(400), 1, 0));
        // Another number of beams, another gain: neither changes the configuration in force, and
        // the answer is the radar's.
        assert_eq!(come(&message(900, 1.0)), (Some(400), 1, 1));
        assert_eq!(come(&message(400, 1.5)), (Some(400), 1, 2));
        assert_eq!(come(&message(400, 1.0)), (Some(400), 2, 2));
        // A radar that was configured anew sends that twice.
        assert_eq!(come(&message(800, 1.0)), (Some(400), 2, 3));
        assert_eq!(come(&message(800, 1.0)), (Some(800), 3, 3));
        // What no radar has is none at all.
        assert_eq!(come(&message(800, f32::NAN)), (Some(800), 3, 3));
        assert_eq!(come(&message(800, -1.0)), (Some(800), 3, 3));
    }
}
