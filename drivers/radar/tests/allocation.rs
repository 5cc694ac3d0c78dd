//! Steady state allocates nothing. Alone in its file: the allocator is the process's.

use randt_counting_allocator::{CountingAllocator, allocations};
use randt_messages::{Message, RadarScan, Return, SensorKind};
use randt_radar::beam_udp::BeamUdpDecoder;
use randt_radar::beam_udp::packet::{Format, Packet};
use randt_radar::{BeamDecoder, Streams};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A beam of `returns` returns.
fn datagram(number: u32, returns: u16) -> Vec<u8> {
    let values: Vec<u8> = (0..returns).flat_map(|bin| [bin as u8, 0, 99, 0]).collect();
    let packet = Packet {
        format: Format::Sparse,
        device: 1,
        sweep: number / 220,
        beam: (number % 220) as u16,
        beams: 220,
        fragment: 0,
        fragments: 1,
        first_bin: 0,
        flags: 0,
        azimuth: (u64::from(number % 220) * (1 << 32) / 220) as u32,
        device_ns: 1_000_000_000 + u64::from(number) * 909_091,
        resolution_um: 16_100,
        offset_um: 0,
        values: &values,
    };
    let mut datagram = Vec::new();
    packet.encode(&mut datagram);
    datagram
}

#[test]
fn nothing_is_allocated_in_steady_state() {
    let returns = |number: u32| {
        if number < 220 * 4 {
            250
        } else {
            20 + (number % 200) as u16
        }
    };
    let datagrams: Vec<Vec<u8>> = (0..220 * 200).map(|n| datagram(n, returns(n))).collect();
    let mut decoder = BeamUdpDecoder::new(0.0);
    let mut streams = Streams::new(200_000_000, 1_000_000_000);
    let mut message = Message::<RadarScan>::default();
    message
        .items
        .resize(randt_messages::MAX_RETURNS, Return::default());
    let mut sweeps = 0;
    let mut before = 0;
    for (number, datagram) in datagrams.iter().enumerate() {
        // After four of the largest sweeps there is room for all; and the clock's window of half a
        // minute is full.
        if number == 220 * 160 {
            before = allocations();
        }
        let arrival_ns = 2_000_000_000 + number as i64 * 909_091;
        decoder.decode(datagram, arrival_ns, &mut |beam| {
            streams.push(beam, &mut |sweep| {
                sweep.write_head(SensorKind::IsdrC, &mut message.head);
                sweep.write_items(&mut message.items);
                sweeps += 1;
            });
        });
    }
    let after = allocations();
    assert_eq!(after - before, 0, "allocations in 40 sweeps");
    assert_eq!(sweeps, 200);
}
