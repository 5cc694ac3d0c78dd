//! Numbers as few bytes: whole ones by their size, floats by how far they are from what is
//! expected.

/// Appends numbers.
pub(super) struct Packer<'a>(pub &'a mut Vec<u8>);

impl Packer<'_> {
    /// Seven bits a byte, the least first.
    pub fn whole(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    /// A number of small size takes few bytes, whichever its sign.
    pub fn signed(&mut self, value: i64) {
        self.whole(((value << 1) ^ (value >> 63)) as u64);
    }

    /// All bits as they are.
    pub fn double(&mut self, value: f64) {
        self.0.extend_from_slice(&value.to_bits().to_le_bytes());
    }

    /// The difference of two counts, around the end of the range where that is shorter.
    pub fn step(&mut self, from: u32, to: u32) {
        self.signed(i64::from(to.wrapping_sub(from) as i32));
    }
}

/// Takes numbers from the front of bytes; `None` where they are not what a packer wrote.
#[derive(Clone, Debug)]
pub(super) struct Unpacker<'a>(pub &'a [u8]);

impl<'a> Unpacker<'a> {
    /// The next `count` bytes.
    pub fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    /// The next ones as an array.
    pub fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    /// What [`Packer::whole`] wrote.
    #[inline]
    pub fn whole(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.0.split_first()?;
            self.0 = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// What [`Packer::signed`] wrote.
    #[inline]
    pub fn signed(&mut self) -> Option<i64> {
        let value = self.whole()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// What [`Packer::double`] wrote.
    pub fn double(&mut self) -> Option<f64> {
        Some(f64::from_bits(u64::from_le_bytes(self.array()?)))
    }

    /// What [`Packer::step`] wrote.
    #[inline]
    pub fn step(&mut self, from: u32) -> Option<u32> {
        Some(from.wrapping_add(self.signed()? as u32))
    }
}

/// A column of floats, each expected to be the last one or to go on as the last two did.
///
/// Returns of one beam lie on a line, a few range bins apart: what is left is rounding, a byte
/// instead of four.
#[derive(Default)]
pub(super) struct Column {
    last: f32,
    before: f32,
}

impl Column {
    /// Appends a value, bit by bit what it is.
    #[inline]
    pub fn pack(&mut self, value: f32, goes_on: bool, packer: &mut Packer<'_>) {
        packer.step(self.expected(goes_on), rank(value));
        self.follow(value);
    }

    /// Takes one.
    #[inline]
    pub fn unpack(&mut self, goes_on: bool, unpacker: &mut Unpacker<'_>) -> Option<f32> {
        let value = unrank(unpacker.step(self.expected(goes_on))?);
        self.follow(value);
        Some(value)
    }

    fn expected(&self, goes_on: bool) -> u32 {
        let next = match goes_on {
            true => 2.0 * self.last - self.before,
            false => self.last,
        };
        // Bits of a computed NaN depend on the machine.
        rank(if next.is_finite() { next } else { 0.0 })
    }

    fn follow(&mut self, value: f32) {
        (self.before, self.last) = (self.last, value);
    }
}

/// The rank of a float among all of them: neighbours differ by one.
fn rank(value: f32) -> u32 {
    let bits = value.to_bits();
    match bits >> 31 {
        0 => bits | 0x8000_0000,
        _ => !bits,
    }
}

fn unrank(rank: u32) -> f32 {
    f32::from_bits(match rank >> 31 {
        0 => !rank,
        _ => rank & 0x7fff_ffff,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_come_back(whole: u64, signed: i64, double: u64, from: u32, to: u32, columns: Vec<(u32, bool)>) {
            let mut bytes = Vec::new();
            let mut packer = Packer(&mut bytes);
            packer.whole(whole);
            packer.signed(signed);
            packer.double(f64::from_bits(double));
            packer.step(from, to);
            let mut column = Column::default();
            for (bits, goes_on) in &columns {
                column.pack(f32::from_bits(*bits), *goes_on, &mut packer);
            }
            let mut unpacker = Unpacker(&bytes);
            prop_assert_eq!(unpacker.whole(), Some(whole));
            prop_assert_eq!(unpacker.signed(), Some(signed));
            prop_assert_eq!(unpacker.double().map(f64::to_bits), Some(double));
            prop_assert_eq!(unpacker.step(from), Some(to));
            let mut column = Column::default();
            for (bits, goes_on) in &columns {
                let value = column.unpack(*goes_on, &mut unpacker);
                prop_assert_eq!(value.map(f32::to_bits), Some(*bits));
            }
            prop_assert!(unpacker.0.is_empty());
        }

        #[test]
        fn floats_are_ranked_by_their_size(a: f32, b: f32) {
            prop_assert_eq!(a.total_cmp(&b), rank(a).cmp(&rank(b)));
            prop_assert_eq!(unrank(rank(a)).to_bits(), a.to_bits());
        }
    }

    #[test]
    fn a_number_without_end_is_none() {
        assert_eq!(Unpacker(&[0xff; 30]).whole(), None);
        assert_eq!(Unpacker(&[0x80]).whole(), None);
        assert_eq!(Unpacker(&[]).double(), None);
    }
}
