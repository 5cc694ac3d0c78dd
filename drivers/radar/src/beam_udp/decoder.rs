//! Datagrams of beam-udp to beams: fragments are joined.

use super::packet::{CLOCKWISE, Packet, Refusal};
use crate::{BeamDecoder, BeamLayout, Place, RawBeam, Sender};
use randt_config::{DevicePin, RadarDriver, SenderPin};
use randt_device::Count;
use randt_messages::MAX_BEAMS;
use std::net::SocketAddr;

/// Beams of one sender that are being joined at a time: datagrams may change places within one beam.
const JOINED_OF_ONE: usize = 2;
/// Beams of all senders that are being joined: what one sender leaves incomplete takes no room from another.
const JOINED: usize = 8;

#[derive(Clone, Copy, Debug, Default)]
struct Counters {
    datagrams: u64,
    foreign: u64,
    versions: u64,
    damaged: u64,
    senseless: u64,
    devices: u64,
    senders: u64,
    incomplete: u64,
    fragments_doubled: u64,
}

/// A beam that lacks fragments.
#[derive(Debug, Default)]
struct Joined {
    /// `None`: free.
    of: Option<Joining>,
    /// Number and checksum of the fragments that are here.
    fragments: Vec<(u8, u32)>,
    beam: RawBeam,
}

/// What the fragments of a beam have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Joining {
    sender: Sender,
    sweep: u32,
    beam: u16,
    fragments: u8,
}

/// beam-udp to beams: of all senders, or of those that the configuration pins.
#[derive(Debug)]
pub struct BeamUdpDecoder {
    keep_power: f32,
    device: DevicePin,
    sender: SenderPin,
    from: Option<SocketAddr>,
    /// Of the last beam.
    heard: Option<(Sender, BeamLayout)>,
    joined: [Joined; JOINED],
    beam: RawBeam,
    counters: Counters,
}

impl BeamUdpDecoder {
    /// Returns must be above `keep_power`. Takes every sender's.
    pub fn new(keep_power: f32) -> Self {
        Self {
            keep_power,
            device: DevicePin::default(),
            sender: SenderPin::default(),
            from: None,
            heard: None,
            joined: Default::default(),
            beam: RawBeam::default(),
            counters: Counters::default(),
        }
    }

    /// Takes only what `radar.device` and `radar.sender` say.
    pub fn pin(&mut self, radar: &RadarDriver) {
        (self.device, self.sender) = (radar.device, radar.sender);
    }

    /// Where the datagrams come from that are decoded from now on.
    pub fn sent_from(&mut self, address: Option<SocketAddr>) {
        self.from = address;
    }

    /// The radar and its beams, for people.
    pub fn about(&self) -> String {
        match self.heard {
            None => "nothing heard yet".to_owned(),
            Some((sender, layout)) => format!(
                "{sender}, {} beams of {:.4} m bins, {}clockwise",
                layout.beams,
                layout.bin_m,
                if layout.clockwise { "" } else { "counter-" },
            ),
        }
    }

    /// What is listened for, for people: empty where it is everybody.
    pub fn pinned(&self) -> String {
        match (self.device.0, self.sender.ip) {
            (None, None) => String::new(),
            (Some(device), None) => format!(" of device {device} (radar.device)"),
            (None, Some(_)) => format!(" from {} (radar.sender)", self.sender),
            (Some(device), Some(_)) => format!(" of device {device} from {}", self.sender),
        }
    }

    fn take(
        &mut self,
        packet: &Packet<'_>,
        checksum: u32,
        arrival_ns: i64,
        beams: &mut dyn FnMut(&RawBeam),
    ) {
        let sender = Sender {
            device: packet.device,
            address: self.from,
        };
        if packet.fragments == 1 {
            begin(packet, sender, arrival_ns, &mut self.beam);
            self.beam.fingerprint = checksum;
            add(packet, self.keep_power, &mut self.beam);
            self.heard = Some((sender, self.beam.layout));
            beams(&self.beam);
            return;
        }
        let of = Joining {
            sender,
            sweep: packet.sweep,
            beam: packet.beam,
            fragments: packet.fragments,
        };
        let known = self.joined.iter().position(|joined| joined.of == Some(of));
        let at = known.unwrap_or_else(|| self.free(&of));
        let Some(joined) = self.joined.get_mut(at) else {
            return;
        };
        if joined.of != Some(of) {
            joined.of = Some(of);
            joined.fragments.clear();
            begin(packet, sender, arrival_ns, &mut joined.beam);
        }
        let mut here = joined.fragments.iter();
        if let Some((_, copy)) = here.find(|(fragment, _)| *fragment == packet.fragment) {
            joined.beam.contradicted |= *copy != checksum;
            self.counters.fragments_doubled += 1;
            return;
        }
        joined.fragments.push((packet.fragment, checksum));
        joined.beam.fingerprint = joined.beam.fingerprint.wrapping_add(checksum);
        add(packet, self.keep_power, &mut joined.beam);
        if joined.fragments.len() == usize::from(packet.fragments) {
            joined.of = None;
            // Fragments that changed places.
            joined.beam.echoes.sort_unstable_by_key(|echo| echo.bin);
            self.heard = Some((sender, joined.beam.layout));
            beams(&joined.beam);
        }
    }

    /// A place for a new beam: a free one, as long as its sender has no more than its share; or that of an older beam,
    /// which is given up.
    fn free(&mut self, new: &Joining) -> usize {
        let of_sender = |joined: &Joined| joined.of.is_some_and(|of| of.sender == new.sender);
        let all = self.joined.iter().enumerate();
        let own = all.clone().filter(|(_, joined)| of_sender(joined));
        let oldest = |(_, joined): &(usize, &Joined)| joined.beam.arrival_ns;
        let given_up = if own.clone().count() >= JOINED_OF_ONE {
            own.min_by_key(oldest)
        } else if let Some((at, _)) = all.clone().find(|(_, joined)| joined.of.is_none()) {
            return at;
        } else {
            all.min_by_key(oldest)
        };
        self.counters.incomplete += 1;
        given_up.map_or(0, |(at, _)| at)
    }
}

/// What a beam's first fragment says.
fn begin(packet: &Packet<'_>, sender: Sender, arrival_ns: i64, beam: &mut RawBeam) {
    beam.sender = sender;
    (beam.fingerprint, beam.contradicted) = (0, false);
    let bin_m = f64::from(packet.resolution_um) * 1e-6;
    beam.place = Place::Numbered {
        sweep: packet.sweep,
        beam: packet.beam,
    };
    beam.azimuth = packet.azimuth;
    beam.device_ns = i64::try_from(packet.device_ns).ok().filter(|ns| *ns > 0);
    beam.arrival_ns = arrival_ns;
    beam.layout = BeamLayout {
        beams: packet.beams,
        clockwise: packet.flags & CLOCKWISE != 0,
        bin_m,
        first_m: f64::from(packet.offset_um) * 1e-6,
        turn_ns: None,
    };
    beam.echoes.clear();
    beam.dropped = 0;
}

fn add(packet: &Packet<'_>, keep_power: f32, beam: &mut RawBeam) {
    beam.dropped += packet.above(keep_power, &mut beam.echoes);
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
                self.take(&packet, checksum, arrival_ns, beams);
            }
            Err(Refusal::Foreign) => self.counters.foreign += 1,
            Err(Refusal::Version) => self.counters.versions += 1,
            Err(Refusal::Damaged) => self.counters.damaged += 1,
            Err(Refusal::Senseless) => self.counters.senseless += 1,
        }
    }

    fn restart(&mut self) {
        self.heard = None;
        for joined in &mut self.joined {
            joined.of = None;
        }
    }

    fn counts(&self, tell: &mut dyn FnMut(Count)) {
        let counters = &self.counters;
        tell(Count::event("datagrams", counters.datagrams));
        tell(Count::event(
            "datagrams_of_another_protocol",
            counters.foreign,
        ));
        tell(Count::event(
            "datagrams_of_unknown_version",
            counters.versions,
        ));
        tell(Count::event("datagrams_damaged", counters.damaged));
        tell(Count::event("datagrams_senseless", counters.senseless));
        tell(Count::event("datagrams_of_another_radar", counters.devices));
        tell(Count::event(
            "datagrams_of_another_sender",
            counters.senders,
        ));
        tell(Count::event("beams_incomplete", counters.incomplete));
        tell(Count::event(
            "fragments_doubled",
            counters.fragments_doubled,
        ));
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
    fn what_is_pinned_is_all_that_is_heard() {
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
    fn fragments_of_a_stranger_neither_join_a_beam_nor_take_its_place() {
        let mut decoder = BeamUdpDecoder::new(5.0);
        // A fragment of the same beam by another device, and others that stay incomplete.
        let ours = [datagram(0, 0, 2, 0), datagram(0, 1, 2, 2)];
        assert_eq!(beams(&mut decoder, &ours[..1]).len(), 0);
        for port in 0..3 {
            decoder.sent_from(Some(([10, 0, 0, 6], port).into()));
            let strange = [other(datagram(0, 1, 2, 2)), datagram(port, 0, 2, 0)];
            assert_eq!(beams(&mut decoder, &strange).len(), 0);
        }
        decoder.sent_from(None);
        let out = beams(&mut decoder, &ours[1..]);
        assert_eq!((out.len(), out[0].contradicted), (1, false));
        // Copies of a fragment that differ are told.
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
