//! Values come back to the last bit, and only what was saved is accepted.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use nalgebra::Matrix3;
use randt_persist::{
    Error, Persist, Reader, StateIdentity, Writer, append, decode, encode, persist, persist_enum,
    variant_code,
};
use std::collections::VecDeque;

#[derive(Clone, Debug, Default, PartialEq)]
struct Part {
    at: Option<i64>,
    pairs: Vec<(f64, u32)>,
}
persist!(Part { at, pairs });

#[derive(Clone, Debug, Default, PartialEq)]
struct Whole {
    parts: VecDeque<Part>,
    matrix: Matrix3<f64>,
    on: [bool; 2],
    used: usize,
    room: usize,
}
persist!(Whole { parts, matrix, on, used } kept { room } sound is_sound);

impl Whole {
    fn is_sound(&self) -> bool {
        self.used <= self.room
    }
}

const IDENTITY: StateIdentity = StateIdentity {
    magic: *b"A STATE ",
    code: *b"00112233aabbccdd",
    config: 7,
};

fn whole() -> Whole {
    let part = |x: f64| Part {
        at: (x > 0.0).then_some(-5),
        pairs: vec![(x, 3), (-0.0, u32::MAX)],
    };
    Whole {
        parts: [part(0.1 + 0.2), part(-1.0), Part::default()].into(),
        matrix: Matrix3::new(1.0, 2.0, 3.0, 4.0, f64::MIN_POSITIVE, 6.0, 7.0, 8.0, 9.0),
        on: [true, false],
        used: 3,
        room: 4,
    }
}

fn bytes(whole: &Whole) -> Vec<u8> {
    let mut bytes = vec![0; 1000];
    let length = encode(&IDENTITY, &mut bytes, |out| whole.save(out)).unwrap();
    bytes.truncate(length);
    bytes
}

fn read(identity: &StateIdentity, bytes: &[u8], room: usize) -> Result<Whole, Error> {
    let mut whole = Whole {
        room,
        ..Whole::default()
    };
    let mut from = decode(identity, bytes)?;
    whole.restore(&mut from)?;
    from.end()?;
    Ok(whole)
}

#[test]
fn what_was_saved_comes_back() {
    assert_eq!(read(&IDENTITY, &bytes(&whole()), 4), Ok(whole()));
}

#[test]
fn a_buffer_that_is_too_small_says_how_much_is_needed() {
    let length = bytes(&whole()).len();
    for room in 0..length {
        let result = encode(&IDENTITY, &mut vec![0; room], |out| whole().save(out));
        let needed = length;
        assert_eq!(result, Err(Error::Room { needed, room }));
    }
}

#[test]
fn every_cut_and_every_flipped_bit_is_found() {
    let bytes = bytes(&whole());
    for length in 0..bytes.len() {
        assert!(
            read(&IDENTITY, &bytes[..length], 4).is_err(),
            "cut to {length}"
        );
    }
    for bit in 0..8 * bytes.len() {
        let mut bytes = bytes.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&IDENTITY, &bytes, 4).is_err(), "bit {bit}");
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    assert!(matches!(
        read(&IDENTITY, &longer, 4),
        Err(Error::Length { .. })
    ));
}

#[test]
fn a_state_of_another_build_or_configuration_is_refused_by_name() {
    let bytes = bytes(&whole());
    let text = |identity: &StateIdentity| read(identity, &bytes, 4).unwrap_err().to_string();
    let code = *b"ffeeddccbbaa9988";
    let other_code = text(&StateIdentity { code, ..IDENTITY });
    assert!(other_code.contains("other source") && other_code.contains("00112233aabbccdd"));
    assert!(
        text(&StateIdentity {
            config: 8,
            ..IDENTITY
        })
        .contains("another configuration")
    );
    let magic = *b"B STATE ";
    assert!(text(&StateIdentity { magic, ..IDENTITY }).contains("A STATE "));
}

#[test]
fn impossible_values_are_refused_and_a_false_length_asks_for_no_memory() {
    let result = read(&IDENTITY, &bytes(&whole()), 2);
    assert_eq!(result, Err(Error::Unsound("Whole")));
    let mut bytes = [0; 64];
    let mut out = Writer::new(&mut bytes);
    u64::MAX.save(&mut out);
    let mut list = Vec::<f64>::new();
    assert_eq!(list.restore(&mut Reader::new(&bytes)), Err(Error::Shape));
    assert!(list.capacity() < 100);
    let mut flag = true;
    assert!(flag.restore(&mut Reader::new(&[2])).is_err());
}

#[derive(Clone, Debug, Default, PartialEq)]
enum Origin {
    #[default]
    Unknown,
    Appearance {
        distance: f64,
        yaw_rad: f64,
    },
    Named(String),
}
persist_enum!(Origin { Unknown, Appearance { distance, yaw_rad }, Named(name) });

/// The same enum in a later build: in another order, with a variant more and one renamed.
#[derive(Debug, Default, PartialEq)]
enum LaterOrigin {
    Manual,
    Titled(String),
    #[default]
    Unknown,
    Appearance {
        distance: f64,
        yaw_rad: f64,
    },
}
persist_enum!(LaterOrigin {
    Manual,
    Titled as "Named"(name),
    Unknown,
    Appearance { distance, yaw_rad }
});

fn restored<T: Persist + Default>(bytes: &[u8]) -> Result<T, Error> {
    let mut value = T::default();
    let mut from = Reader::new(bytes);
    value.restore(&mut from)?;
    from.end()?;
    Ok(value)
}

#[test]
fn variants_are_saved_by_name() {
    let appearance = Origin::Appearance {
        distance: 0.1 + 0.2,
        yaw_rad: -0.0,
    };
    let all = vec![Origin::Unknown, appearance, Origin::Named("é".into())];
    let mut bytes = vec![7];
    append(&mut bytes, |out| all.save(out));
    assert_eq!(bytes.remove(0), 7, "what was there stays");
    assert_eq!(restored::<Vec<Origin>>(&bytes), Ok(all));
    assert_eq!(bytes[8..12], variant_code("Unknown").to_le_bytes());
    assert_eq!(variant_code("foobar"), 0xbf9c_f968, "FNV-1a, 32 bits");

    let later: Vec<LaterOrigin> = restored(&bytes).unwrap();
    assert_eq!(later[0], LaterOrigin::Unknown);
    assert_eq!(later[2], LaterOrigin::Titled("é".into()));

    let mut newer = Vec::new();
    append(&mut newer, |out| LaterOrigin::Manual.save(out));
    assert_eq!(restored::<Origin>(&newer), Err(Error::Unsound("Origin")));
    // A text that is no UTF-8.
    let end = bytes.len() - 1;
    bytes[end] = 0xff;
    assert_eq!(
        restored::<Vec<Origin>>(&bytes),
        Err(Error::Unsound("String"))
    );
}

#[test]
fn small_numbers_take_few_bytes() {
    for (value, length) in [(0, 1), (127, 1), (128, 2), (1 << 62, 9), (u64::MAX, 10)] {
        let mut bytes = Vec::new();
        append(&mut bytes, |out| out.varint(value));
        assert_eq!(bytes.len(), length);
        let mut from = Reader::new(&bytes);
        assert_eq!(from.varint(), Ok(value));
        assert_eq!(from.end(), Ok(()));
    }
    let mut overlong = Reader::new(&[0xff; 11]);
    assert_eq!(overlong.varint(), Err(Error::Unsound("varint")));
}
