//! A keyframe as few bytes: the beams that there are, the points by what is new in each. Nothing
//! is rounded.

use super::pack::{Column, Packer, Unpacker};
use randt_geometry::Pose2;
use randt_messages::{
    Keyframe, KeyframeBeam, KeyframeHead, KeyframePoint, Message, MessageRef, Topic,
};

/// Fewest bytes that a point takes.
const POINT_BYTES_MIN: usize = 3;

/// What is packed of a keyframe. Journals of form 0 do not have how it was judged, and may go on
/// with keyframes of form 1.
const FORM: u64 = 1;
/// The same of one that is forgotten: no beams and no points, but where it stands.
const FORGOTTEN: u64 = 2;

/// Where a keyframe that has left the graph stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AttachedPose {
    /// Number of the keyframe that it stands on.
    pub to: u64,
    /// Seen from that one: x m, y m, yaw rad.
    pub to_from_base: [f64; 3],
}

impl AttachedPose {
    /// Seen from the keyframe that it stands on.
    pub fn pose(&self) -> Pose2 {
        Pose2::from_array(self.to_from_base)
    }
}

/// Appends a keyframe that is forgotten: its numbers, and where it stands.
pub(super) fn pack_forgotten(head: &KeyframeHead, attached: &AttachedPose, out: &mut Vec<u8>) {
    let mut packer = Packer(out);
    pack_numbers(head, [0, FORGOTTEN, 0], &mut packer);
    packer.whole(attached.to);
    attached
        .to_from_base
        .iter()
        .for_each(|value| packer.double(*value));
}

/// Reads where a keyframe stands; `None` where it is not forgotten.
pub(super) fn unpack_attached(bytes: &[u8]) -> Option<AttachedPose> {
    let mut unpacker = Unpacker(bytes);
    let numbers = unpack_numbers(&mut unpacker, &mut KeyframeHead::default())?;
    numbers.attached
}

/// Appends a keyframe; epoch and time of publishing are not kept.
pub(super) fn pack(keyframe: MessageRef<'_, Keyframe>, out: &mut Vec<u8>) {
    let head = keyframe.head;
    let mut packer = Packer(out);
    let counts = [head.beam_count.into(), FORM, keyframe.items.len() as u64];
    pack_numbers(head, counts, &mut packer);

    let (mut x_m, mut y_m, mut azimuth_rad) = <(Column, Column, Column)>::default();
    let mut first_point = 0;
    for beam in head.beams.iter().take(head.beam_count as usize) {
        x_m.pack(beam.x_m, true, &mut packer);
        y_m.pack(beam.y_m, true, &mut packer);
        azimuth_rad.pack(beam.azimuth_rad, true, &mut packer);
        packer.step(first_point, beam.first_point);
        first_point = beam.first_point;
    }

    let (mut x_m, mut y_m, mut intensity) = <(Column, Column, Column)>::default();
    let mut last = 0;
    for beam in keyframe.items.chunk_by(|a, b| tag(a) == tag(b)) {
        let tag = beam.first().map_or(0, tag);
        packer.step(last, tag);
        packer.whole(beam.len() as u64);
        last = tag;
        for (n, point) in beam.iter().enumerate() {
            x_m.pack(point.x_m, n > 1, &mut packer);
            y_m.pack(point.y_m, n > 1, &mut packer);
            intensity.pack(point.intensity, false, &mut packer);
        }
    }
}

/// Appends the numbers in front of the beams: of these counts beams, form and points.
fn pack_numbers(head: &KeyframeHead, counts: [u64; 3], packer: &mut Packer<'_>) {
    packer.whole(head.header.sequence);
    packer.signed(head.header.stamp_ns);
    let numbers = [
        head.id,
        head.odom_frame_id,
        head.submap_id,
        head.submap_root,
        head.scan_sequence,
    ];
    let judged = [head.trust, head.trust_reasons, head.localizability].map(u64::from);
    let numbers = numbers.into_iter().chain(counts).chain(judged);
    numbers.for_each(|number| packer.whole(number));
    let values = head.pose.iter().chain(&head.covariance).chain(&head.twist);
    values.for_each(|value| packer.double(*value));
    packer.double(head.weak_direction_rad);
}

/// Reads what [`pack`] wrote over a message; `None` where that is something else.
pub(super) fn unpack(bytes: &[u8], out: &mut Message<Keyframe>) -> Option<()> {
    let mut unpacker = Unpacker(bytes);
    let head = &mut *out.head;
    *head = KeyframeHead::default();
    let count = unpack_numbers(&mut unpacker, head)?.points;
    let (mut x_m, mut y_m, mut azimuth_rad) = <(Column, Column, Column)>::default();
    let mut first_point = 0;
    for beam in head.beams.iter_mut().take(head.beam_count as usize) {
        *beam = KeyframeBeam {
            x_m: x_m.unpack(true, &mut unpacker)?,
            y_m: y_m.unpack(true, &mut unpacker)?,
            azimuth_rad: azimuth_rad.unpack(true, &mut unpacker)?,
            first_point: unpacker.step(first_point)?,
        };
        first_point = beam.first_point;
    }

    // Before room is made: what the bytes can hold and a message may.
    if count > Keyframe::MAX_ITEMS || count > unpacker.0.len() / POINT_BYTES_MIN {
        return None;
    }
    out.items.clear();
    out.items.reserve(count);
    let (mut x_m, mut y_m, mut intensity) = <(Column, Column, Column)>::default();
    let mut tag = 0;
    while out.items.len() < count {
        tag = unpacker.step(tag)?;
        let beam_count = usize::try_from(unpacker.whole()?).ok()?;
        if beam_count == 0 || beam_count > count - out.items.len() {
            return None;
        }
        for n in 0..beam_count {
            out.items.push(KeyframePoint {
                x_m: x_m.unpack(n > 1, &mut unpacker)?,
                y_m: y_m.unpack(n > 1, &mut unpacker)?,
                intensity: intensity.unpack(false, &mut unpacker)?,
                beam: tag as u16,
                reserved: (tag >> 16) as u16,
            });
        }
    }
    unpacker.0.is_empty().then_some(())
}

/// What stands in front of the beams beside the head.
pub(super) struct Numbers {
    /// How many points there are.
    points: usize,
    /// Where it stands if it is forgotten.
    attached: Option<AttachedPose>,
}

/// Reads the numbers in front of the beams over a head, which keeps its beams.
pub(super) fn unpack_numbers(
    unpacker: &mut Unpacker<'_>,
    head: &mut KeyframeHead,
) -> Option<Numbers> {
    head.header.sequence = unpacker.whole()?;
    head.header.stamp_ns = unpacker.signed()?;
    head.id = unpacker.whole()?;
    head.odom_frame_id = unpacker.whole()?;
    head.submap_id = unpacker.whole()?;
    head.submap_root = unpacker.whole()?;
    head.scan_sequence = unpacker.whole()?;
    head.beam_count = unpacker.whole()?.try_into().ok()?;
    let form = unpacker.whole()?;
    let count = usize::try_from(unpacker.whole()?).ok()?;
    let is_judged = matches!(form, FORM | FORGOTTEN);
    if is_judged {
        head.trust = unpacker.whole()?.try_into().ok()?;
        head.trust_reasons = unpacker.whole()?.try_into().ok()?;
        head.localizability = unpacker.whole()?.try_into().ok()?;
    } else if form == 0 {
        (head.trust, head.trust_reasons, head.localizability) = (0, 0, 0);
        head.weak_direction_rad = 0.0;
    } else {
        return None;
    }
    let values = head.pose.iter_mut().chain(&mut head.covariance);
    for value in values.chain(&mut head.twist) {
        *value = unpacker.double()?;
    }
    if is_judged {
        head.weak_direction_rad = unpacker.double()?;
    }
    let mut attached = None;
    if form == FORGOTTEN {
        let found = attached.insert(AttachedPose::default());
        found.to = unpacker.whole()?;
        for value in &mut found.to_from_base {
            *value = unpacker.double()?;
        }
    }
    let points = count;
    Some(Numbers { points, attached })
}

/// What is the same for all points of a beam.
fn tag(point: &KeyframePoint) -> u32 {
    u32::from(point.beam) | u32::from(point.reserved) << 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use randt_messages::MAX_BEAMS;

    fn bytes(keyframe: &Message<Keyframe>) -> Vec<u8> {
        let mut bytes = Vec::new();
        keyframe.as_ref().write_bytes(&mut bytes);
        bytes
    }

    fn packed(keyframe: &Message<Keyframe>) -> Vec<u8> {
        let mut bytes = Vec::new();
        pack(keyframe.as_ref(), &mut bytes);
        bytes
    }

    /// Any message: bits of every kind of float, beams that jump.
    fn keyframes() -> impl Strategy<Value = Message<Keyframe>> {
        let numbers = prop::collection::vec(any::<u64>(), 27);
        let beams = prop::collection::vec(any::<[u32; 4]>(), 0..8);
        let points = prop::collection::vec((any::<[u32; 3]>(), 0..3_u16, 0..2_u16), 0..40);
        (numbers, beams, points).prop_map(|(numbers, beams, points)| {
            let mut keyframe = Message::<Keyframe>::default();
            let head = &mut *keyframe.head;
            head.header.sequence = numbers[0];
            head.header.stamp_ns = numbers[1] as i64;
            head.id = numbers[2];
            head.odom_frame_id = numbers[3];
            head.submap_id = numbers[4];
            head.submap_root = numbers[5];
            head.scan_sequence = numbers[6];
            head.trust = numbers[7] as u32;
            head.trust_reasons = numbers[24] as u32;
            head.localizability = numbers[25] as u32;
            head.weak_direction_rad = f64::from_bits(numbers[26]);
            let doubles = head.pose.iter_mut().chain(&mut head.covariance);
            for (value, bits) in doubles.chain(&mut head.twist).zip(&numbers[8..]) {
                *value = f64::from_bits(*bits);
            }
            head.beam_count = beams.len() as u32;
            for (beam, [x, y, azimuth, first_point]) in head.beams.iter_mut().zip(beams) {
                *beam = KeyframeBeam {
                    x_m: f32::from_bits(x),
                    y_m: f32::from_bits(y),
                    azimuth_rad: f32::from_bits(azimuth),
                    first_point,
                };
            }
            keyframe.items.extend(
                points
                    .into_iter()
                    .map(|([x, y, intensity], beam, reserved)| KeyframePoint {
                        x_m: f32::from_bits(x),
                        y_m: f32::from_bits(y),
                        intensity: f32::from_bits(intensity),
                        beam,
                        reserved,
                    }),
            );
            keyframe
        })
    }

    proptest! {
        #[test]
        fn a_keyframe_comes_back_to_the_last_bit(keyframe in keyframes(), mut reused in keyframes(), hostile: Vec<u8>) {
            let packed = packed(&keyframe);
            prop_assert!(unpack(&packed, &mut reused).is_some());
            prop_assert_eq!(bytes(&reused), bytes(&keyframe));
            // Neither less nor more nor anything else is a keyframe, and nothing panics.
            for end in 0..packed.len() {
                prop_assert!(unpack(&packed[..end], &mut reused).is_none());
            }
            let more = [&packed[..], &[0]].concat();
            prop_assert!(unpack(&more, &mut reused).is_none());
            unpack(&hostile, &mut reused);
        }

        #[test]
        fn flipped_bits_do_not_panic(keyframe in keyframes(), at: prop::sample::Index, bit in 0..8_u8) {
            let mut packed = packed(&keyframe);
            let at = at.index(packed.len());
            packed[at] ^= 1 << bit;
            let mut out = Message::default();
            unpack(&packed, &mut out);
            prop_assert!(out.items.capacity() <= packed.len());
        }
    }

    #[test]
    fn a_table_that_claims_more_beams_than_there_are_has_all_of_them() {
        let mut keyframe = Message::<Keyframe>::default();
        keyframe.head.beam_count = u32::MAX;
        keyframe.head.beams[MAX_BEAMS - 1].x_m = 1.0;
        let mut out = Message::default();
        unpack(&packed(&keyframe), &mut out).unwrap();
        assert_eq!(bytes(&out), bytes(&keyframe));
    }
}
