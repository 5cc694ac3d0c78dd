//! Well-formed messages with wrong content, as another sender or a defective device sends them.
//! The same seed draws the same.

/// Bytes of a message that are changed at most.
const CHANGED_MAX: u64 = 4;

/// Draws what is wrong.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrongContent {
    random: u64,
}

impl WrongContent {
    /// By a seed.
    pub fn new(seed: u64) -> Self {
        // Seeds that follow each other are far apart.
        let random = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        Self { random }
    }

    /// A number below another one; 0 below 0.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11).checked_rem(limit).unwrap_or(0)
    }

    /// One to four bytes become others.
    pub fn change(&mut self, bytes: &mut [u8]) {
        for _ in 0..=self.below(CHANGED_MAX) {
            let at = self.below(bytes.len() as u64) as usize;
            let other = self.below(256) as u8;
            if let Some(byte) = bytes.get_mut(at) {
                *byte = other;
            }
        }
    }
}
