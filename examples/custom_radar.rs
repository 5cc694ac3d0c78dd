//! A radar of one's own: a decoder of its bytes. Sweeps, times and losses come from the driver's
//! crate, the filter and everything after it does not know the difference.
//!
//! The radar of this example sends a line a beam: `sweep beam beams azimuth_deg device_ns range_m
//! power [range_m power ...]`. The program reads such lines and prints what the filter keeps.
//!
//! ```text
//! cargo run -p randt-examples --bin custom_radar < beams.txt
//! ```

use randt_config::Config;
use randt_device::Count;
use randt_filter::ClusterFilter;
use randt_messages::{MAX_BEAMS, Message, RadarPoints, SensorKind};
use randt_radar::{BeamDecoder, BeamLayout, BeamPosition, Echo, RawBeam, Streams};
use std::io::Read;

/// Width of this radar's range bins, m.
const BIN_M: f64 = 0.05;

/// Lines to beams. Only whole lines are read; one that makes no sense is counted.
#[derive(Default)]
struct LineRadar {
    pending: Vec<u8>,
    beam: RawBeam,
    lines_bad: u64,
}

impl LineRadar {
    /// Reads a line into the beam that is used over and over; `None` where it makes no sense.
    fn read(&mut self, line: &str, arrival_ns: i64) -> Option<()> {
        let mut words = line.split_ascii_whitespace();
        let sweep = words.next()?.parse().ok()?;
        let (beam, beams) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        let azimuth_deg: f64 = words.next()?.parse().ok()?;
        let device_ns = words.next()?.parse().ok()?;
        let is_sensible = beam < beams && (3..=MAX_BEAMS as u16).contains(&beams);
        (is_sensible && azimuth_deg.is_finite()).then_some(())?;
        self.beam.position = BeamPosition::Numbered { sweep, beam };
        // 2^32 are one turn.
        self.beam.azimuth = (azimuth_deg.rem_euclid(360.0) / 360.0 * 4_294_967_296.0) as u32;
        self.beam.device_ns = Some(device_ns);
        self.beam.arrival_ns = arrival_ns;
        self.beam.layout = BeamLayout {
            beams,
            bin_m: BIN_M,
            first_m: BIN_M / 2.0,
            ..BeamLayout::default()
        };
        self.beam.echoes.clear();
        while let Some(range_m) = words.next() {
            let range_m: f64 = range_m.parse().ok()?;
            let intensity: f32 = words.next()?.parse().ok()?;
            let bin = (range_m / BIN_M) as u16;
            self.beam.echoes.push(Echo { bin, intensity });
        }
        Some(())
    }
}

impl BeamDecoder for LineRadar {
    fn decode(&mut self, bytes: &[u8], arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        self.pending.extend_from_slice(bytes);
        while let Some(end) = self.pending.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.pending.drain(..=end).collect();
            match self.read(&String::from_utf8_lossy(&line), arrival_ns) {
                Some(()) => beams(&self.beam),
                None => self.lines_bad += 1,
            }
        }
    }

    fn restart(&mut self) {
        self.pending.clear();
    }

    fn counts(&self, visit: &mut dyn FnMut(Count)) {
        visit(Count::loss("lines_bad", self.lines_bad));
    }
}

fn main() -> anyhow::Result<()> {
    let config = Config::default();
    let turn_ns = (config.sensor.period_s * 1e9) as i64;
    let mut radar = LineRadar::default();
    let mut streams = Streams::new(turn_ns, 10 * turn_ns);
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();

    let (mut input, mut arrival_ns) = (std::io::stdin().lock(), 0);
    let mut bytes = [0; 4096];
    loop {
        let count = input.read(&mut bytes)?;
        if count == 0 {
            break;
        }
        // A driver takes the host's clock here.
        arrival_ns += 1_000_000;
        radar.decode(
            bytes.get(..count).unwrap_or_default(),
            arrival_ns,
            &mut |beam| {
                streams.push(beam, &mut |sweep| {
                    filter.process(sweep.message(SensorKind::Unknown).as_ref(), &mut points);
                    let (beams, kept) = (sweep.beams(), points.items.len());
                    println!(
                        "sweep of {beams} beams, {} returns, {kept} kept",
                        sweep.len()
                    );
                });
            },
        );
    }
    radar.counts(&mut |count| eprintln!("{} {}", count.name, count.value));
    Ok(())
}
