//! The most returns that a message holds.

use randt_messages::MAX_RETURNS;

/// The strongest of the items, as many as a message holds, in their order; of equal ones the first.
pub(crate) fn strongest<T: Copy>(items: &[T], strength: impl Fn(&T) -> f32) -> Vec<T> {
    if items.len() <= MAX_RETURNS {
        return items.to_vec();
    }
    let mut ranked: Vec<(f32, usize)> = items.iter().map(&strength).zip(0..).collect();
    ranked.select_nth_unstable_by(MAX_RETURNS, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    ranked.truncate(MAX_RETURNS);
    ranked.sort_unstable_by_key(|(_, index)| *index);
    ranked
        .iter()
        .filter_map(|(_, index)| items.get(*index).copied())
        .collect()
}
