//! A figure with its uncertainty, from parts of a drive that each show it.

/// A figure and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// The estimate of one part of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PartialEstimate {
    pub value: f64,
    /// Its information, in any unit.
    pub weight: f64,
}

/// Parts from which a spread can be estimated: a Student distribution of fewer has no variance.
pub(crate) const ESTIMATES_MIN: usize = 4;
/// Deviations above this many robust standard deviations lose weight (Huber): 95 % efficient with
/// good data.
const HUBER: f64 = 1.5;
const ROUNDS: u32 = 10;

impl Estimate {
    /// The same in another unit.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            sigma: self.sigma * factor.abs(),
        }
    }

    /// With an error on top that repeats itself in every part, so that their spread does not show
    /// it.
    pub(crate) fn with_systematic(self, sigma: f64) -> Self {
        Self {
            sigma: (self.sigma * self.sigma + sigma * sigma).sqrt(),
            ..self
        }
    }
}

/// The robust weighted mean. Its sigma comes from how the parts differ (each left out once), not
/// from any model of their noise: whatever is correlated within a part is counted. `None` without
/// any weight.
pub(crate) fn mean(parts: &[PartialEstimate]) -> Option<Estimate> {
    let mut weights: Vec<f64> = parts.iter().map(|part| part.weight).collect();
    let mut value = weighted(parts, &weights)?;
    for _ in 0..ROUNDS {
        let deviation = |part: &PartialEstimate| part.weight.sqrt() * (part.value - value).abs();
        let mut sizes: Vec<f64> = parts.iter().map(deviation).collect();
        let scale = 1.4826 * median(&mut sizes)?;
        for (weight, part) in weights.iter_mut().zip(parts) {
            *weight = part.weight;
            let size = deviation(part);
            if size > HUBER * scale {
                *weight *= HUBER * scale / size;
            }
        }
        value = weighted(parts, &weights).unwrap_or(value);
    }
    let total: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    let count = total * total / squares;
    let shifts = parts
        .iter()
        .zip(&weights)
        .map(|(part, weight)| weight * (part.value - value) / (total - weight).max(1e-3 * total));
    let spread: f64 = shifts.map(|shift| shift * shift).sum();
    // The variance of Student's distribution: few parts are weak evidence of their own spread.
    let student = (count - 1.0) / (count - 3.0).max(0.1);
    let sigma = ((count - 1.0) / count * spread * student.max(1.0)).sqrt();
    Some(Estimate { value, sigma })
}

fn weighted(parts: &[PartialEstimate], weights: &[f64]) -> Option<f64> {
    let total: f64 = weights.iter().sum();
    let terms = parts.iter().zip(weights).map(|(part, w)| part.value * w);
    let sum: f64 = terms.sum();
    (total > 0.0 && sum.is_finite()).then(|| sum / total)
}

/// The middle value; of an even number the upper one.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn parts(values: &[f64]) -> Vec<PartialEstimate> {
        let part = |value: &f64| PartialEstimate {
            value: *value,
            weight: 2.0,
        };
        values.iter().map(part).collect()
    }

    #[test]
    fn the_spread_of_many_parts_gives_the_sigma_of_their_mean() {
        let values: Vec<f64> = (0..101).map(|i| f64::from(i) - 50.0).collect();
        let found = mean(&parts(&values)).unwrap();
        assert!(found.value.abs() < 1e-9);
        // A uniform spread of 29.2, over 101 parts.
        assert!((found.sigma - 2.9).abs() < 0.3, "{found:?}");
    }

    #[test]
    fn one_part_that_is_far_off_has_little_weight() {
        let found = mean(&parts(&[1.0, 1.1, 0.9, 1.05, 0.95, 30.0])).unwrap();
        assert!((found.value - 1.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn few_parts_have_a_larger_sigma_than_many_of_the_same_spread() {
        let few = mean(&parts(&[-1.0, 1.0, -1.0, 1.0])).unwrap().sigma;
        let many = mean(&parts(&[-1.0, 1.0].repeat(20))).unwrap().sigma;
        assert!(few > 1.5 * many * 10f64.sqrt(), "{few} {many}");
        assert_eq!(mean(&[]), None);
    }

    #[test]
    fn parts_without_any_weight_give_no_estimate() {
        let nothing = PartialEstimate {
            value: 1.0,
            weight: 0.0,
        };
        assert_eq!(mean(&[nothing; 5]), None);
    }
}
