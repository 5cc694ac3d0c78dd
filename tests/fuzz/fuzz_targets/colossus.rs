//! A Navtech's stream, to the sweep: as it is, and as bodies of messages behind good headers.

#![no_main]

use randt_config::ByteOrder;
use randt_radar::navtech::NavtechDecoder;
use randt_radar::navtech::frame::{Frame, kind};
use randt_radar::{Assembler, BeamDecoder};

/// The configuration of a CTS350-X, but with eight beams a turn: sweeps must come about.
const CONFIGURATION: [u8; 20] = [
    0, 8, 1, 182, 14, 184, 21, 224, 15, 160, 6, 64, 0x3f, 0x80, 0, 0, 0, 0, 0, 0,
];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut stream = Vec::new();
    for body in std::iter::once(CONFIGURATION.as_slice()).chain(bytes.split(|byte| *byte == 0xfd)) {
        let kind = match body.len() {
            20 => kind::CONFIGURATION,
            length if length % 2 == 0 => kind::FFT_8,
            _ => kind::FFT_16,
        };
        Frame { version: 1, kind, payload: body }.encode(&mut stream);
    }
    stream.extend_from_slice(bytes);
    let mut decoder = NavtechDecoder::new(0.0, ByteOrder::Auto);
    let mut assembler = Assembler::new(250_000_000);
    let piece = usize::from(bytes.first().copied().unwrap_or(0)) + 1;
    for (arrival_ns, piece) in (0..).zip(stream.chunks(piece)) {
        decoder.decode(piece, arrival_ns * 1_000_000, &mut |beam| {
            assembler.push(beam, &mut |sweep| {
                sweep.message(randt_messages::SensorKind::NavtechCts);
            });
        });
    }
});
