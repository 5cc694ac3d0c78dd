//! Fragments of beam-udp to beams.

use super::packet::{CLOCKWISE, Packet};
use crate::{BeamLayout, BeamPosition, RawBeam, Sender};

/// Beams of one sender that are being joined at a time: datagrams of one beam may be reordered.
const OF_ONE_SENDER: usize = 2;
/// Beams of all senders that are being joined: what one sender leaves incomplete takes no room
/// from another.
const BEAMS: usize = 8;

/// What the fragments of a beam have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct BeamKey {
    sender: Sender,
    sweep: u32,
    beam: u16,
    fragments: u8,
}

/// A beam that lacks fragments.
#[derive(Debug, Default)]
struct PartialBeam {
    /// `None`: free.
    key: Option<BeamKey>,
    /// Number and checksum of the fragments that are here.
    fragments: Vec<(u8, u32)>,
    beam: RawBeam,
}

/// Joins fragments of several beams at once.
#[derive(Debug, Default)]
pub(super) struct FragmentJoiner {
    beams: [PartialBeam; BEAMS],
    /// A beam of one fragment, which needs no joining.
    whole: RawBeam,
    /// Beams that were given up.
    pub incomplete: u64,
    pub doubled: u64,
}

impl FragmentJoiner {
    /// Forgets what is half joined.
    pub fn restart(&mut self) {
        for beam in &mut self.beams {
            beam.key = None;
        }
    }

    /// Takes a datagram with its checksum; gives the beam that it completes, with returns above
    /// `keep_power`.
    pub fn push(
        &mut self,
        packet: &Packet<'_>,
        checksum: u32,
        sender: Sender,
        keep_power: f32,
        arrival_ns: i64,
    ) -> Option<&RawBeam> {
        if packet.fragments == 1 {
            begin(packet, sender, arrival_ns, &mut self.whole);
            self.whole.fingerprint = checksum;
            self.whole.dropped = packet.above(keep_power, &mut self.whole.echoes);
            return Some(&self.whole);
        }
        let key = BeamKey {
            sender,
            sweep: packet.sweep,
            beam: packet.beam,
            fragments: packet.fragments,
        };
        let known = self.beams.iter().position(|beam| beam.key == Some(key));
        let index = known.unwrap_or_else(|| self.free(&key));
        let partial = self.beams.get_mut(index)?;
        if partial.key != Some(key) {
            partial.key = Some(key);
            partial.fragments.clear();
            begin(packet, sender, arrival_ns, &mut partial.beam);
        }
        let mut here = partial.fragments.iter();
        if let Some((_, copy)) = here.find(|(fragment, _)| *fragment == packet.fragment) {
            partial.beam.contradicted |= *copy != checksum;
            self.doubled += 1;
            return None;
        }
        partial.fragments.push((packet.fragment, checksum));
        partial.beam.fingerprint = partial.beam.fingerprint.wrapping_add(checksum);
        partial.beam.dropped += packet.above(keep_power, &mut partial.beam.echoes);
        if partial.fragments.len() != usize::from(packet.fragments) {
            return None;
        }
        partial.key = None;
        // Fragments may have been reordered.
        partial.beam.echoes.sort_unstable_by_key(|echo| echo.bin);
        Some(&partial.beam)
    }

    /// The index for a new beam: a free one, as long as its sender has no more than its share; or
    /// that of an older beam, which is given up.
    fn free(&mut self, new: &BeamKey) -> usize {
        let of_sender = |beam: &PartialBeam| beam.key.is_some_and(|key| key.sender == new.sender);
        let all = self.beams.iter().enumerate();
        let own = all.clone().filter(|(_, beam)| of_sender(beam));
        let oldest = |(_, beam): &(usize, &PartialBeam)| beam.beam.arrival_ns;
        let given_up = if own.clone().count() >= OF_ONE_SENDER {
            own.min_by_key(oldest)
        } else if let Some((index, _)) = all.clone().find(|(_, beam)| beam.key.is_none()) {
            return index;
        } else {
            all.min_by_key(oldest)
        };
        self.incomplete += 1;
        given_up.map_or(0, |(index, _)| index)
    }
}

/// Begins a beam by its first fragment.
fn begin(packet: &Packet<'_>, sender: Sender, arrival_ns: i64, beam: &mut RawBeam) {
    beam.sender = sender;
    (beam.fingerprint, beam.contradicted) = (0, false);
    let bin_m = f64::from(packet.resolution_um) * 1e-6;
    beam.position = BeamPosition::Numbered {
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
