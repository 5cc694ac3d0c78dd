//! `cargo bench -p randt-radar`: what a sweep of a Navtech costs, 400 beams of 3768 bins of 8 bit.
//!
//! Prints the processor's time from bytes to the laid out message (decoding, joining, timing,
//! writing), median and p99, and as a share of one core at 4 Hz; and the time from a sweep's last
//! beam to its message. Without the socket.
#![allow(clippy::unwrap_used)]

use randt_config::ByteOrder;
use randt_messages::{Message, RadarScan, Return, SensorKind};
use randt_radar::navtech::NavtechDecoder;
use randt_radar::navtech::configuration::{Configuration, Details};
use randt_radar::navtech::fft::{Bins, Fft};
use randt_radar::navtech::frame::{Frame, kind};
use randt_radar::navtech::order::Order;
use randt_radar::{Assembler, BeamDecoder};
use rustix::time::{ClockId, clock_gettime};

const AZIMUTHS: u16 = 400;
const BINS: usize = 3768;
const ENCODER: u16 = 5600;
const SWEEPS: usize = 400;
const TURN_NS: i64 = 250_000_000;
/// About what the noise of a CTS350-X leaves above 60: 30,000 returns a sweep.
const KEEP_POWER: f32 = 60.0;

fn main() {
    let mut random = 1_u64;
    let mut power = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        // One in fifty is an echo, the rest noise around 45.
        if random.is_multiple_of(50) {
            61 + (random >> 40) % 100
        } else {
            30 + (random >> 40) % 30
        }
    };
    let powers: Vec<u8> = (0..BINS * usize::from(AZIMUTHS))
        .map(|_| power() as u8)
        .collect();

    let mut decoder = NavtechDecoder::new(KEEP_POWER, ByteOrder::Auto);
    let mut assembler = Assembler::new(TURN_NS);
    let mut message = Message::<RadarScan>::default();
    message
        .items
        .resize(randt_messages::MAX_RETURNS, Return::default());
    decoder.decode(&configuration(), 0, &mut |_| {});

    let (mut costs, mut ends, mut returns) = (Vec::new(), Vec::new(), 0);
    let mut counter = 0_u16;
    for sweep in 0..SWEEPS {
        let beams: Vec<Vec<u8>> = (0..AZIMUTHS)
            .map(|azimuth| {
                let first = usize::from(azimuth) * BINS;
                let row = powers.get(first..first + BINS).unwrap();
                let at_ns = sweep as i64 * TURN_NS + i64::from(azimuth) * 625_000;
                counter = counter.wrapping_add(1);
                beam(counter, azimuth, at_ns, row)
            })
            .collect();
        let (mut cost, mut end) = (0.0, 0.0);
        for (azimuth, bytes) in beams.iter().enumerate() {
            let arrival_ns = 5 + sweep as i64 * TURN_NS + azimuth as i64 * 625_000;
            let begin = processor_s();
            decoder.decode(bytes, arrival_ns, &mut |beam| {
                assembler.push(beam, &mut |whole| {
                    returns = whole.len();
                    whole.write_head(SensorKind::NavtechCts, &mut message.head);
                    whole.write_items(message.items.get_mut(..whole.len()).unwrap());
                });
            });
            end = processor_s() - begin;
            cost += end;
        }
        costs.push(cost);
        ends.push(end);
    }
    // The first ones find the order of bytes and the room that is needed.
    let mut costs = costs.split_off(10);
    let mut ends = ends.split_off(10);
    costs.sort_by(f64::total_cmp);
    ends.sort_by(f64::total_cmp);
    let at = |sorted: &[f64], share: f64| {
        sorted
            .get((sorted.len() as f64 * share) as usize)
            .copied()
            .unwrap()
    };
    println!("{AZIMUTHS} x {BINS} bins of 8 bit, {returns} returns above {KEEP_POWER}");
    let (median, worst) = (at(&costs, 0.5), at(&costs, 0.99));
    println!(
        "a sweep: median {:.2} ms, p99 {:.2} ms; at 4 Hz {:.2} % and {:.2} % of a core",
        median * 1e3,
        worst * 1e3,
        median * 400.0,
        worst * 400.0
    );
    println!(
        "from the last beam to the message: median {:.0} us, p99 {:.0} us",
        at(&ends, 0.5) * 1e6,
        at(&ends, 0.99) * 1e6
    );
}

/// The processor's time of this thread: others on the machine do not count.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn frame(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let version = 1;
    Frame {
        version,
        kind,
        payload,
    }
    .encode(&mut bytes);
    bytes
}

fn configuration() -> Vec<u8> {
    let mut body = Vec::new();
    Configuration {
        azimuths: AZIMUTHS,
        bin_size_01mm: 438,
        bins: BINS as u16,
        encoder_size: ENCODER,
        rotation_mhz: 4000,
        packets_per_s: 1600,
        range_gain: 1.0,
        range_offset_m: 0.0,
        details: Details::default(),
    }
    .encode(&mut body);
    frame(kind::CONFIGURATION, &body)
}

fn beam(counter: u16, azimuth: u16, at_ns: i64, powers: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    Fft {
        counter,
        azimuth: azimuth * (ENCODER / AZIMUTHS),
        time: Order::Little.encode(1_700_000_000_000_000_000 + at_ns),
        bins: Bins::Eight(powers),
    }
    .encode(&mut body);
    frame(kind::FFT_8, &body)
}
