//! Datagrams of beam-udp, to the sweep: as they are, and with magic and checksum put right.

#![no_main]

use randt_radar::beam_udp::BeamUdpDecoder;
use randt_radar::beam_udp::packet::{MAGIC, VERSION, crc32c};
use randt_radar::{Assembler, BeamDecoder};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut decoder = BeamUdpDecoder::new(0.0);
    let mut assembler = Assembler::new(200_000_000);
    let mut take = |datagram: &[u8], arrival_ns| {
        decoder.decode(datagram, arrival_ns, &mut |beam| {
            assembler.push(beam, &mut |sweep| {
                sweep.message(randt_messages::SensorKind::IsdrC);
            });
        });
    };
    for (arrival_ns, fields) in (0_i64..).zip(bytes.chunks(55)) {
        take(fields, arrival_ns * 1_000_000);
        let mut datagram = [MAGIC.as_slice(), &[VERSION], fields].concat();
        let crc = crc32c(&datagram);
        datagram.extend_from_slice(&crc.to_le_bytes());
        take(&datagram, arrival_ns * 1_000_000);
    }
});
