//! Which byte of an azimuth's stamp comes first.
//!
//! In the vendor's C++ and Python it is the lowest, in its C# and wiki the highest. The epoch is
//! no help: a radar without a time server counts from its own start. Successive stamps are: in the
//! right order they rise by fractions of a second, in the wrong one they leap.

use crate::bytes::Bytes;
use randt_config::ByteOrder;

/// Stamps in a row that must follow each other before the order counts as found.
const ROW: u32 = 16;
/// Longest plausible step from one beam to the next, ns: a radar turns in 0.25 s, and a beam or
/// two may be lost.
const STEP_MAX_NS: i64 = 1_000_000_000;

/// An order of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Lowest byte first.
    Little,
    /// Highest byte first.
    Big,
}

impl Order {
    /// Seconds and nanoseconds as ns; `None` where the second has more than its nanoseconds.
    pub fn decode(self, time: [u8; 8]) -> Option<i64> {
        let mut bytes = Bytes(&time);
        let (seconds, ns) = match self {
            Self::Little => (bytes.u32_le()?, bytes.u32_le()?),
            Self::Big => (bytes.u32_be()?, bytes.u32_be()?),
        };
        (ns < 1_000_000_000).then_some(i64::from(seconds) * 1_000_000_000 + i64::from(ns))
    }

    /// Seconds (of 32 bits) and nanoseconds.
    pub fn encode(self, time_ns: i64) -> [u8; 8] {
        let seconds = time_ns.div_euclid(1_000_000_000) as u32;
        let ns = time_ns.rem_euclid(1_000_000_000) as u32;
        let join = |upper: u32, lower: u32| u64::from(upper) << 32 | u64::from(lower);
        match self {
            Self::Little => join(ns, seconds).to_le_bytes(),
            Self::Big => join(seconds, ns).to_be_bytes(),
        }
    }
}

/// For how many stamps in a row one order has made sense.
#[derive(Clone, Copy, Debug, Default)]
struct Trial {
    last_ns: Option<i64>,
    row: u32,
}

impl Trial {
    fn push(&mut self, stamp_ns: Option<i64>) {
        let step_ns = self.last_ns.zip(stamp_ns).map(|(last_ns, ns)| ns - last_ns);
        self.row = match step_ns {
            // Beams of one burst may have one stamp, which is no evidence.
            Some(0) => self.row,
            Some(1..=STEP_MAX_NS) => self.row + 1,
            _ => 0,
        };
        self.last_ns = stamp_ns;
    }
}

/// Finds the order and reads stamps by it.
#[derive(Clone, Debug)]
pub struct Stamps {
    wanted: ByteOrder,
    little: Trial,
    big: Trial,
    chosen: Option<Order>,
}

impl Stamps {
    /// By an order that is configured, or is to be found.
    pub fn new(wanted: ByteOrder) -> Self {
        Self {
            wanted,
            little: Trial::default(),
            big: Trial::default(),
            chosen: None,
        }
    }

    /// A beam's time, ns of the radar's clock; `None` as long as stamps do not follow each other:
    /// then only the time of arrival is known.
    pub fn read(&mut self, time: [u8; 8]) -> Option<i64> {
        if self.chosen.is_none() {
            self.little.push(Order::Little.decode(time));
            self.big.push(Order::Big.decode(time));
            self.chosen = self.choice();
        }
        self.chosen.and_then(|order| order.decode(time))
    }

    /// Another radar, perhaps.
    pub fn restart(&mut self) {
        *self = Self::new(self.wanted);
    }

    fn choice(&self) -> Option<Order> {
        let little = self.wanted != ByteOrder::Big && self.little.row >= ROW;
        let big = self.wanted != ByteOrder::Little && self.big.row >= ROW;
        match (little, big) {
            (true, false) => Some(Order::Little),
            (false, true) => Some(Order::Big),
            // Both at once is next to impossible, and no reason to choose.
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn feed(stamps: &mut Stamps, begin_ns: i64, order: Order) -> Option<usize> {
        (0..400).find(|i| {
            let time = order.encode(begin_ns + *i as i64 * 625_000);
            stamps.read(time).is_some()
        })
    }

    proptest! {
        /// From any epoch, a radar that has just started included.
        #[test]
        fn both_orders_are_found(begin_s in 0..u32::MAX, ns in 0..1_000_000_000_i64, big in any::<bool>()) {
            let order = if big { Order::Big } else { Order::Little };
            let mut stamps = Stamps::new(ByteOrder::Auto);
            let begin_ns = i64::from(begin_s) * 1_000_000_000 + ns;
            let after = feed(&mut stamps, begin_ns, order);
            prop_assert!(after.is_some_and(|after| after < 40), "{:?}", after);
            prop_assert_eq!(stamps.chosen, Some(order));
            prop_assert_eq!(order.decode(order.encode(begin_ns)), Some(begin_ns));
        }
    }

    #[test]
    fn stamps_that_make_no_sense_are_none() {
        for wanted in [ByteOrder::Auto, ByteOrder::Little, ByteOrder::Big] {
            let mut stamps = Stamps::new(wanted);
            for i in 0..2000_u64 {
                assert_eq!(stamps.read([0; 8]), None);
                let noise = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
                assert_eq!(stamps.read(noise.to_le_bytes()), None);
            }
        }
    }

    #[test]
    fn a_configured_order_holds() {
        let mut stamps = Stamps::new(ByteOrder::Little);
        assert_eq!(
            feed(&mut stamps, 1_700_000_000_000_000_000, Order::Big),
            None
        );
    }
}
