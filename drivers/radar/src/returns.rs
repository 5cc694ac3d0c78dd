//! The returns of a sweep while it is collected: no more than a few times what a message holds.

use randt_messages::{MAX_RETURNS, Return};

/// Returns that are held before the weakest are dropped. Room to spare, so that the search for
/// them is rare.
const HELD: usize = 4 * MAX_RETURNS;

/// Returns by beam; their `beam` is the index of the beam in the order of arrival.
#[derive(Debug, Default)]
pub(crate) struct Returns {
    pub items: Vec<Return>,
    scratch: Vec<f32>,
    /// Returns that were dropped.
    pub over: u32,
}

impl Returns {
    pub fn clear(&mut self) {
        self.items.clear();
        self.over = 0;
    }

    pub fn push(&mut self, item: Return) {
        if self.items.len() >= HELD {
            self.limit();
        }
        self.items.push(item);
    }

    /// Leaves the strongest, as many as a message holds; of equal ones the first.
    pub fn limit(&mut self) {
        let surplus = self.items.len().saturating_sub(MAX_RETURNS);
        if surplus == 0 {
            return;
        }
        self.scratch.clear();
        let (scratch, intensities) = (&mut self.scratch, self.items.iter().map(|i| i.intensity));
        scratch.extend(intensities);
        // The strongest of those that are dropped has this intensity.
        let (weaker, edge, _) = scratch.select_nth_unstable_by(surplus - 1, f32::total_cmp);
        let edge = *edge;
        let below = weaker.iter().filter(|i| i.total_cmp(&edge).is_lt()).count();
        let is_equal = |item: &&Return| item.intensity.total_cmp(&edge).is_eq();
        let equal = self.items.iter().filter(is_equal).count();
        let mut room = equal - (surplus - below).min(equal);
        self.items
            .retain(|item| match item.intensity.total_cmp(&edge) {
                std::cmp::Ordering::Less => false,
                std::cmp::Ordering::Greater => true,
                std::cmp::Ordering::Equal => {
                    let stays = room > 0;
                    room -= usize::from(stays);
                    stays
                }
            });
        self.over += surplus as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_stay_in_their_order_of_equal_ones_the_first() {
        let mut returns = Returns::default();
        let count = HELD + 1000;
        let intensity = |i: usize| ((i.wrapping_mul(7919)) % 97) as f32;
        for i in 0..count {
            returns.push(Return {
                range_m: i as f32,
                intensity: intensity(i),
                beam: (i / 1000) as u16,
                bin: 0,
            });
        }
        returns.limit();
        let mut plain: Vec<usize> = (0..count).collect();
        plain.sort_by(|a, b| intensity(*b).total_cmp(&intensity(*a)).then(a.cmp(b)));
        plain.truncate(MAX_RETURNS);
        plain.sort_unstable();
        let kept: Vec<usize> = returns.items.iter().map(|r| r.range_m as usize).collect();
        assert!(kept == plain);
        assert_eq!(returns.over as usize, count - MAX_RETURNS);
    }
}
