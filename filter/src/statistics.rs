//! Running mean and variance of vectors, mergeable without loss.

use nalgebra::Vector3;
use randt_persist::persist;

/// Count, mean and squared deviations, by the updates of Welford (one value) and Chan (two sets):
/// nothing cancels, however small the variance beside the mean.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Statistics {
    pub count: f64,
    pub mean: Vector3<f64>,
    squares: Vector3<f64>,
}

persist!(Statistics {
    count,
    mean,
    squares
});

impl Statistics {
    pub(crate) fn push(&mut self, value: Vector3<f64>) {
        self.count += 1.0;
        let before = value - self.mean;
        self.mean += before / self.count;
        self.squares += before.component_mul(&(value - self.mean));
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        let count = self.count + other.count;
        if count > 0.0 {
            let apart = other.mean - self.mean;
            self.mean += apart * (other.count / count);
            let between = self.count * other.count / count;
            self.squares += other.squares + apart.component_mul(&apart) * between;
            self.count = count;
        }
    }

    /// Sample variance, axis by axis; zero for fewer than two values.
    pub(crate) fn variance(&self) -> Vector3<f64> {
        self.squares / (self.count - 1.0).max(1.0)
    }

    /// Root of the sum of the axes' variances.
    pub(crate) fn deviation(&self) -> f64 {
        self.variance().sum().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn merging_is_as_good_as_adding(
            values in prop::collection::vec(prop::array::uniform3(-50.0..50.0_f64), 2..60),
            cut in 0_usize..60,
        ) {
            let (mut one, mut left, mut right) = <(Statistics, Statistics, Statistics)>::default();
            for (i, value) in values.iter().enumerate() {
                one.push(Vector3::from(*value));
                let side = if i < cut { &mut left } else { &mut right };
                side.push(Vector3::from(*value));
            }
            left.merge(&right);
            prop_assert!((one.mean - left.mean).norm() < 1e-9);
            prop_assert!((one.variance() - left.variance()).norm() < 1e-7);
            prop_assert_eq!(one.count, left.count);
        }
    }
}
