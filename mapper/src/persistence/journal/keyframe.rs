//! A keyframe as few bytes: the beams that there are, the points by what is new in each. Nothing
//! is rounded.

use super::pack::{Column, Packer, Unpacker};
use randt_messages::{
    Keyframe, KeyframeBeam, KeyframeHead, KeyframePoint, Message, MessageRef, Topic,
};

/// Fewest bytes that a point takes.
const POINT_BYTES_MIN: usize = 3;

/// What is packed of a keyframe. Journals of form 0 do not have how it was judged, and may go on
/// with keyframes of form 1.
const FORM: u64 = 1;

/// Appends a keyframe; epoch and time of publishing are not kept.
pub(super) fn pack(keyframe: MessageRef<'_, Keyframe>, out: &mut Vec<u8>) {
    let head = keyframe.head;
    let mut packer = Packer(out);
    packer.whole(head.header.sequence);
    packer.signed(head.header.stamp_ns);
    let numbers = [
        head.id,
        head.odom_frame_id,
        head.submap_id,
        head.submap_root,
        head.scan_sequence,
        u64::from(head.beam_count),
        FORM,
        keyframe.items.len() as u64,
        u64::from(head.trust),
        u64::from(head.trust_reasons),
        u64::from(head.localizability),
    ];
    numbers.into_iter().for_each(|number| packer.whole(number));
    let values = head.pose.iter().chain(&head.covariance).chain(&head.twist);
    values.for_each(|value| packer.double(*value));
    packer.double(head.weak_direction_rad);

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

/// Reads what [`pack`] wrote over a message; `None` where that is something else.
pub(super) fn unpack(bytes: &[u8], out: &mut Message<Keyframe>) -> Option<()> {
    let mut unpacker = Unpacker(bytes);
    let head = &mut *out.head;
    *head = KeyframeHead::default();
    let count = unpack_numbers(&mut unpacker, head)?;
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

/// Reads the numbers in front of the beams over a head, which keeps its beams; gives how many
/// points there are.
pub(super) fn unpack_numbers(
    unpacker: &mut Unpacker<'_>,
    head: &mut KeyframeHead,
) -> Option<usize> {
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
    if form == FORM {
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
    if form == FORM {
        head.weak_direction_rad = unpacker.double()?;
    }
    Some(count)
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
