//! Text lines: a stream, in pieces, and datagrams.

#![no_main]

use randt_imu::line::{LineDecoder, LineMessage};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut decoder = LineDecoder::default();
    let mut came = 0;
    for piece in bytes.chunks(1 + bytes.len() % 61) {
        decoder.stream(piece, &mut |_| came += 1);
    }
    decoder.opened();
    decoder.datagram(bytes, &mut |_| came += 1);
    assert_eq!(decoder.lines(), came);
    if let Ok(message) = LineMessage::decode(bytes) {
        let line = message.encode();
        let again = LineMessage::decode(line.trim_end().as_bytes());
        assert_eq!(again, Ok(message));
    }
});
