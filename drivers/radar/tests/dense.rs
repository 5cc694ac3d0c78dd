//! What is recorded with all bins is read back as what was published.

use randt_config::{Config, RadarSource};
use randt_messages::SensorKind;
use randt_radar::Radar;
use randt_radar::navtech::configuration::{Configuration, Details};
use randt_radar::navtech::fft::{Bins, Fft};
use randt_radar::navtech::frame::{Frame, kind};
use randt_radar::navtech::order::Order;
use randt_readers::{Event, Options, open};
use std::io::Write;
use std::net::TcpListener;
use std::time::{Duration, Instant};

const AZIMUTHS: u16 = 400;
const BINS: usize = 300;
const TURNS: u16 = 4;
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
const POWER_MIN: f32 = 60.0;

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

/// All that a radar sends in some turns; a contour shortens some beams.
fn stream() -> Vec<u8> {
    let mut body = Vec::new();
    Configuration {
        azimuths: AZIMUTHS,
        bin_size_01mm: 438,
        bins: BINS as u16,
        encoder_size: 5600,
        rotation_mhz: 4000,
        packets_per_s: 1600,
        range_gain: 1.0,
        range_offset_m: 0.0,
        details: Details::default(),
    }
    .encode(&mut body);
    let mut bytes = frame(kind::CONFIGURATION, &body);
    for beam in 0..AZIMUTHS * TURNS {
        let powers: Vec<u8> = (0..BINS - usize::from(beam % 7))
            .map(|bin| ((bin * 31 + usize::from(beam) * 17) % 90) as u8)
            .collect();
        body.clear();
        Fft {
            counter: beam,
            azimuth: beam % AZIMUTHS * 14,
            time: Order::Big.encode(EPOCH_NS + i64::from(beam) * 625_000),
            bins: Bins::Eight(&powers),
        }
        .encode(&mut body);
        bytes.extend(frame(kind::FFT_8, &body));
    }
    bytes
}

#[test]
fn the_images_hold_what_was_published() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut config = Config::default();
    config.radar.source = RadarSource::Navtech;
    config.radar.address = listener.local_addr().unwrap().to_string();
    config.sensor.keep_power = f64::from(POWER_MIN);
    config.sensor.period_s = 0.25;
    config.record.dense = folder.path().to_str().unwrap().to_owned();
    let mut radar = Radar::new(&config).unwrap();
    let server = std::thread::spawn(move || {
        let (mut stream_to, _) = listener.accept().unwrap();
        // Slower than the radar would, so that no image is dropped.
        for piece in stream().chunks(100_000) {
            stream_to.write_all(piece).unwrap();
            std::thread::sleep(Duration::from_millis(40));
        }
        stream_to
    });
    let begin = Instant::now();
    let mut published = Vec::new();
    while published.len() < usize::from(TURNS) - 1 {
        assert!(
            begin.elapsed() < Duration::from_secs(240),
            "{:?}",
            radar.counters()
        );
        let now_ns = EPOCH_NS + begin.elapsed().as_nanos() as i64;
        radar.poll(now_ns, &mut |sweep| {
            published.push(sweep.message(SensorKind::NavtechCts))
        });
        std::thread::sleep(Duration::from_micros(200));
    }
    let lost = radar.lost();
    assert_eq!(lost, 0, "{:?}", radar.counters());
    // Writes what waits.
    drop(radar);
    server.join().unwrap();

    let options = Options {
        power_min: POWER_MIN,
        bin_size_m: Some(0.0438),
        ..Options::default()
    };
    let mut source = open(folder.path(), &options).unwrap();
    let mut read = Vec::new();
    while let Some(event) = source.next_event().unwrap() {
        if let Event::Scan(scan) = event {
            read.push(scan);
        }
    }
    assert_eq!(read.len(), published.len());
    for (read, published) in read.iter().zip(&published) {
        assert_eq!(read.items.len(), published.items.len());
        for (a, b) in read.items.iter().zip(&published.items) {
            assert_eq!((a.beam, a.bin, a.intensity), (b.beam, b.bin, b.intensity));
            assert!((a.range_m - b.range_m).abs() < 1e-5);
        }
        let (a, b) = (&read.head.sweep, &published.head.sweep);
        assert!(
            (a.end_ns - b.end_ns).abs() < 5_000,
            "{} {}",
            a.end_ns,
            b.end_ns
        );
        for (a, b) in a.beams().iter().zip(b.beams()) {
            assert!((a.azimuth_rad - b.azimuth_rad).abs() < 1e-6);
            assert!((a.stamp_ns - b.stamp_ns).abs() < 5_000);
        }
    }
}
