//! Datagrams of beam-udp to beams: fragments are joined.

use super::packet::{CLOCKWISE, Packet, Refusal};
use crate::{BeamDecoder, BeamLayout, Place, RawBeam};
use randt_device::Count;
use randt_messages::MAX_BEAMS;

/// Beams that are being joined at a time: datagrams may change places within one beam.
const JOINED: usize = 2;

#[derive(Clone, Copy, Debug, Default)]
struct Counters {
    datagrams: u64,
    foreign: u64,
    versions: u64,
    damaged: u64,
    senseless: u64,
    devices: u64,
    incomplete: u64,
    fragments_doubled: u64,
}

/// A beam that lacks fragments.
#[derive(Debug, Default)]
struct Joined {
    /// Sweep, beam, fragments; `None`: free.
    of: Option<(u32, u16, u8)>,
    seen: [u64; 4],
    count: u8,
    beam: RawBeam,
}

/// beam-udp to beams, of one radar: the first one that is heard.
#[derive(Debug)]
pub struct BeamUdpDecoder {
    keep_power: f32,
    device: Option<u32>,
    joined: [Joined; JOINED],
    beam: RawBeam,
    counters: Counters,
}

impl BeamUdpDecoder {
    /// Returns must be above `keep_power`.
    pub fn new(keep_power: f32) -> Self {
        Self {
            keep_power,
            device: None,
            joined: Default::default(),
            beam: RawBeam::default(),
            counters: Counters::default(),
        }
    }

    /// The radar and its beams, for people.
    pub fn about(&self) -> String {
        match self.device {
            None => "nothing heard yet".to_owned(),
            Some(device) => format!(
                "device {device}, {} beams of {:.4} m bins, {}clockwise",
                self.beam.layout.beams,
                self.beam.layout.bin_m,
                if self.beam.layout.clockwise {
                    ""
                } else {
                    "counter-"
                },
            ),
        }
    }

    fn take(&mut self, packet: &Packet<'_>, arrival_ns: i64, beams: &mut dyn FnMut(&RawBeam)) {
        if packet.fragments == 1 {
            begin(packet, arrival_ns, &mut self.beam);
            add(packet, self.keep_power, &mut self.beam);
            beams(&self.beam);
            return;
        }
        let of = Some((packet.sweep, packet.beam, packet.fragments));
        let known = self.joined.iter().position(|joined| joined.of == of);
        let Some(joined) = known
            .or_else(|| self.free(packet))
            .and_then(|at| self.joined.get_mut(at))
        else {
            return;
        };
        if joined.of != of {
            *joined = Joined {
                of,
                beam: std::mem::take(&mut joined.beam),
                ..Joined::default()
            };
            begin(packet, arrival_ns, &mut joined.beam);
        }
        let bit = 1_u64 << (packet.fragment % 64);
        let seen = joined.seen.get_mut(usize::from(packet.fragment / 64));
        if seen.is_some_and(|seen| std::mem::replace(seen, *seen | bit) & bit != 0) {
            self.counters.fragments_doubled += 1;
            return;
        }
        joined.count += 1;
        add(packet, self.keep_power, &mut joined.beam);
        if joined.count == packet.fragments {
            joined.of = None;
            // Fragments that changed places.
            joined.beam.echoes.sort_unstable_by_key(|echo| echo.bin);
            self.beam.layout = joined.beam.layout;
            beams(&joined.beam);
        }
    }

    /// A place for a new beam: a free one, or that of the older beam, which is given up.
    fn free(&mut self, packet: &Packet<'_>) -> Option<usize> {
        if let Some(free) = self.joined.iter().position(|joined| joined.of.is_none()) {
            return Some(free);
        }
        self.counters.incomplete += 1;
        let age = |joined: &Joined| {
            let (sweep, beam, _) = joined.of.unwrap_or_default();
            (
                packet.sweep.wrapping_sub(sweep),
                packet.beam.wrapping_sub(beam),
            )
        };
        (0..JOINED).max_by_key(|at| self.joined.get(*at).map(age))
    }
}

/// What a beam's first fragment says.
fn begin(packet: &Packet<'_>, arrival_ns: i64, beam: &mut RawBeam) {
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
        match Packet::decode(bytes) {
            Ok(packet) if !(3..=MAX_BEAMS as u16).contains(&packet.beams) => {
                self.counters.senseless += 1;
            }
            Ok(packet) if *self.device.get_or_insert(packet.device) != packet.device => {
                self.counters.devices += 1;
            }
            Ok(packet) => self.take(&packet, arrival_ns, beams),
            Err(Refusal::Foreign) => self.counters.foreign += 1,
            Err(Refusal::Version) => self.counters.versions += 1,
            Err(Refusal::Damaged) => self.counters.damaged += 1,
            Err(Refusal::Senseless) => self.counters.senseless += 1,
        }
    }

    fn restart(&mut self) {
        self.device = None;
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

    #[test]
    fn another_radar_on_the_same_address_is_not_mixed_in() {
        let mut decoder = BeamUdpDecoder::new(0.0);
        let mut other = datagram(1, 0, 1, 0);
        other[8] = 2;
        let end = other.len() - 4;
        let crc = crate::beam_udp::crc::crc32c(&other[..end]);
        other[end..].copy_from_slice(&crc.to_le_bytes());
        let datagrams = [datagram(0, 0, 1, 0), other, b"hello".to_vec()];
        assert_eq!(beams(&mut decoder, &datagrams).len(), 1);
        assert_eq!(count(&decoder, "datagrams_of_another_radar"), 1);
        assert_eq!(count(&decoder, "datagrams_of_another_protocol"), 1);
    }
}
