//! Xsens MTData2: a stream, in pieces.

#![no_main]

use randt_imu::xsens::{Item, Message, Xsens};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut xsens = Xsens::new(250.0);
    let mut readings = Vec::new();
    for piece in bytes.chunks(1 + bytes.len() % 61) {
        xsens.take(piece, 0, &mut readings);
        xsens.send(0);
    }
    xsens.opened();
    assert!(xsens.counts().junk_bytes <= bytes.len() as u64);
    if let Some(message) = Message::from_frame(bytes) {
        for (id, data) in message.items() {
            if let Some(item) = Item::decode(id, data) {
                let mut encoded = Vec::new();
                item.encode(&mut encoded);
                assert_eq!(encoded.get(3..), Some(data));
            }
        }
    }
});
