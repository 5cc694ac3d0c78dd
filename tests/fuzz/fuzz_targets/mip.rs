//! MicroStrain MIP: a stream, in pieces.

#![no_main]

use randt_imu::mip::{Field, Mip, Packet};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut mip = Mip::new(250.0);
    let mut readings = Vec::new();
    for piece in bytes.chunks(1 + bytes.len() % 61) {
        mip.take(piece, 0, &mut readings);
        mip.send(0);
    }
    mip.opened();
    assert!(mip.counts().junk_bytes <= bytes.len() as u64);
    if let Some(packet) = Packet::from_frame(bytes) {
        for (descriptor, data) in packet.fields() {
            if let Some(field) = Field::decode(descriptor, data) {
                assert_eq!(field.encode(), (descriptor, data.to_vec()));
            }
        }
    }
});
