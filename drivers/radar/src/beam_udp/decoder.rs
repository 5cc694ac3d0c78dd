//! Datagrams of beam-udp to beams.

use super::fragments::FragmentJoiner;
use super::packet::{Packet, Refusal};
use crate::counters::counters;
use crate::{BeamDecoder, RawBeam, Sender};
use randt_config::{DevicePin, RadarDriver, SenderPin};
use randt_device::Count;
use randt_messages::MAX_BEAMS;
use std::net::SocketAddr;

counters! {
    /// Datagrams, and what happened to them.
    struct Counters {
        datagrams: event "datagrams",
        foreign: event "datagrams_of_another_protocol",
        versions: event "datagrams_of_unknown_version",
        damaged: event "datagrams_damaged",
        senseless: event "datagrams_senseless",
        devices: event "datagrams_of_another_radar",
        senders: event "datagrams_of_another_sender",
        incomplete: event "beams_incomplete",
        fragments_doubled: event "fragments_doubled",
    }
}

/// beam-udp to beams: of all senders, or of those that the configuration pins.
#[derive(Debug, Default)]
pub struct BeamUdpDecoder {
    keep_power: f32,
    device: DevicePin,
    sender: SenderPin,
    from: Option<SocketAddr>,
    /// Sender and layout of the last beam.
    joiner: FragmentJoiner,
    counters: Counters,
}

impl BeamUdpDecoder {
    /// Returns must be above `keep_power`. Takes every sender's.
    pub fn new(keep_power: f32) -> Self {
        Self {
            keep_power,
            ..Self::default()
        }
    }

    /// Takes only the datagrams of `radar.device` and `radar.sender`.
    pub fn pin(&mut self, radar: &RadarDriver) {
        (self.device, self.sender) = (radar.device, radar.sender);
    }

    /// Where the datagrams come from that are decoded from now on.
    pub fn sent_from(&mut self, address: Option<SocketAddr>) {
        self.from = address;
    }

    /// What is listened for, for people: empty where every sender is.
    pub fn pinned(&self) -> String {
        match (self.device.0, self.sender.ip) {
            (None, None) => String::new(),
            (Some(device), None) => format!(" of device {device} (radar.device)"),
            (None, Some(_)) => format!(" from {} (radar.sender)", self.sender),
            (Some(device), Some(_)) => format!(" of device {device} from {}", self.sender),
        }
    }
}

impl BeamDecoder for BeamUdpDecoder {
    fn decode(&mut self, bytes: &[u8], arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        self.counters.datagrams += 1;
        if self.from.is_some_and(|from| !self.sender.allows(from)) {
            self.counters.senders += 1;
            return;
        }
        match Packet::decode(bytes) {
            Ok(packet) if !(3..=MAX_BEAMS as u16).contains(&packet.beams) => {
                self.counters.senseless += 1;
            }
            Ok(packet) if !self.device.allows(packet.device) => self.counters.devices += 1,
            Ok(packet) => {
                let checksum = bytes.last_chunk().copied().map_or(0, u32::from_le_bytes);
                let (device, address) = (packet.device, self.from);
                let (sender, keep_power) = (Sender { device, address }, self.keep_power);
                let joiner = &mut self.joiner;
                if let Some(beam) = joiner.push(&packet, checksum, sender, keep_power, arrival_ns) {
                    beams(beam);
                }
            }
            Err(Refusal::Foreign) => self.counters.foreign += 1,
            Err(Refusal::Version) => self.counters.versions += 1,
            Err(Refusal::Damaged) => self.counters.damaged += 1,
            Err(Refusal::Senseless) => self.counters.senseless += 1,
        }
    }

    fn restart(&mut self) {
        self.joiner.restart();
    }

    fn counts(&self, visit: &mut dyn FnMut(Count)) {
        let mut counters = self.counters;
        counters.incomplete = self.joiner.incomplete;
        counters.fragments_doubled = self.joiner.doubled;
        counters.visit(visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam_udp::packet::Format;

    fn datagram(beam: u16, fragment: u8, fragments: u8, first_bin: u16) -> Vec<u8> {
        let packet = Packet {
            format: Format::Dense8,
            device: 1,
            sweep: 9,
            beam,
            beams: 220,
            fragment,
            fragments,
            first_bin,
            flags: 0,
            azimuth: 77,
            device_ns: 5,
            resolution_um: 10_000,
            offset_um: 5_000,
            values: &[40, 2],
        };
        let mut bytes = Vec::new();
        packet.encode(&mut bytes);
        bytes
    }

    fn beams(decoder: &mut BeamUdpDecoder, datagrams: &[Vec<u8>]) -> Vec<RawBeam> {
        let mut out = Vec::new();
        for datagram in datagrams {
            decoder.decode(datagram, 100, &mut |beam| out.push(beam.clone()));
        }
        out
    }

    fn count(decoder: &BeamUdpDecoder, name: &str) -> u64 {
        let mut value = 0;
        decoder.counts(&mut |count| {
            if count.name == name {
                value = count.value;
            }
        });
        value
    }

    #[test]
    fn fragments_are_joined_in_any_order_even_of_two_beams_at_once() {
        let mut decoder = BeamUdpDecoder::new(5.0);
        let datagrams = [
            datagram(0, 1, 2, 2),
            datagram(1, 0, 2, 0),
            datagram(1, 0, 2, 0),
            datagram(0, 0, 2, 0),
            datagram(1, 1, 2, 2),
        ];
        let out = beams(&mut decoder, &datagrams);
        assert_eq!(out.len(), 2);
        let bins: Vec<u16> = out[0].echoes.iter().map(|echo| echo.bin).collect();
        assert_eq!((bins, out[0].dropped), (vec![0, 2], 2));
        assert_eq!(out[0].echoes[0].intensity, 20.0);
        assert!((out[0].layout.range_m(2) - 0.025).abs() < 1e-12);
        assert_eq!(count(&decoder, "fragments_doubled"), 1);
    }

    #[test]
    fn a_beam_that_stays_incomplete_is_given_up_for_the_third() {
        let mut decoder = BeamUdpDecoder::new(0.0);
        let datagrams = [
            datagram(0, 0, 2, 0),
            datagram(1, 0, 2, 0),
            datagram(2, 0, 2, 0),
            datagram(2, 1, 2, 2),
            datagram(1, 1, 2, 2),
        ];
        assert_eq!(beams(&mut decoder, &datagrams).len(), 2);
        assert_eq!(count(&decoder, "beams_incomplete"), 1);
    }

    /// A datagram of another device.
    fn other(mut datagram: Vec<u8>) -> Vec<u8> {
        datagram[8] = 2;
        let end = datagram.len() - 4;
        let crc = crate::beam_udp::crc::crc32c(&datagram[..end]);
        datagram[end..].copy_from_slice(&crc.to_le_bytes());
        datagram
    }

    #[test]
    fn only_what_is_pinned_is_decoded() {
        let mut decoder = BeamUdpDecoder::new(0.0);
        decoder.pin(&RadarDriver {
            device: DevicePin(Some(1)),
            sender: SenderPin {
                ip: Some([10, 0, 0, 5].into()),
                port: None,
            },
            ..RadarDriver::default()
        });
        let ours = datagram(0, 0, 1, 0);
        decoder.sent_from(Some(([10, 0, 0, 5], 1).into()));
        let datagrams = [ours.clone(), other(ours.clone()), b"hello".to_vec()];
        assert_eq!(beams(&mut decoder, &datagrams).len(), 1);
        decoder.sent_from(Some(([10, 0, 0, 6], 1).into()));
        assert_eq!(beams(&mut decoder, &datagrams).len(), 0);
        for (name, value) in [
            ("datagrams_of_another_radar", 1),
            ("datagrams_of_another_sender", 3),
            ("datagrams_of_another_protocol", 1),
        ] {
            assert_eq!(count(&decoder, name), value, "{name}");
        }
    }

    #[test]
    fn fragments_of_another_sender_neither_join_a_beam_nor_displace_it() {
        let mut decoder = BeamUdpDecoder::new(5.0);
        // A fragment of the same beam by another device, and others that stay incomplete.
        let ours = [datagram(0, 0, 2, 0), datagram(0, 1, 2, 2)];
        assert_eq!(beams(&mut decoder, &ours[..1]).len(), 0);
        for port in 0..3 {
            decoder.sent_from(Some(([10, 0, 0, 6], port).into()));
            let others = [other(datagram(0, 1, 2, 2)), datagram(port, 0, 2, 0)];
            assert_eq!(beams(&mut decoder, &others).len(), 0);
        }
        decoder.sent_from(None);
        let out = beams(&mut decoder, &ours[1..]);
        assert_eq!((out.len(), out[0].contradicted), (1, false));
        // Copies of a fragment that differ are marked.
        let mut louder = datagram(1, 0, 2, 0);
        let end = louder.len() - 4;
        louder[end - 1] ^= 1;
        let crc = crate::beam_udp::crc::crc32c(&louder[..end]);
        louder[end..].copy_from_slice(&crc.to_le_bytes());
        let copies = [datagram(1, 0, 2, 0), louder, datagram(1, 1, 2, 2)];
        let out = beams(&mut decoder, &copies);
        assert_eq!((out.len(), out[0].contradicted), (1, true));
    }
}
