//! Sample statistics of points (x, y, intensity) that add up exactly.

use randt_persist::persist;

/// Count, mean and scatter of points; the recursive update of Saarinen et al. 2013.
///
/// Merging two equals adding all points of both, so no points need to be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distribution {
    /// Number of points.
    pub count: u32,
    /// Mean of x (m), y (m), intensity.
    pub mean: [f64; 3],
    /// Sums of products of deviations from the mean: xx, xy, yy, xi, yi, ii.
    pub scatter: [f64; 6],
}

persist!(Distribution { count, mean, scatter } sound has_room);

impl Distribution {
    /// Whether as many points can be added again as there are.
    fn has_room(&self) -> bool {
        self.count <= u32::MAX / 2
    }

    /// Adds one point.
    #[inline]
    pub fn add(&mut self, point: [f64; 3]) {
        let count = f64::from(self.count) + 1.0;
        let d = difference(point, self.mean);
        let inverse = 1.0 / count;
        for (mean, d) in self.mean.iter_mut().zip(d) {
            *mean += d * inverse;
        }
        // The product of the deviations from the old and from the new mean: d d^T (n - 1) / n.
        self.add_outer(d, (count - 1.0) * inverse);
        self.count += 1;
    }

    /// Adds all points of another one.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let (a, b) = (f64::from(self.count), f64::from(other.count));
        let d = difference(other.mean, self.mean);
        for (mean, d) in self.mean.iter_mut().zip(d) {
            *mean += d * (b / (a + b));
        }
        for (sum, other) in self.scatter.iter_mut().zip(other.scatter) {
            *sum += other;
        }
        self.add_outer(d, a * b / (a + b));
        self.count += other.count;
    }

    #[inline]
    fn add_outer(&mut self, d: [f64; 3], weight: f64) {
        let [x, y, i] = d;
        let products = [x * x, x * y, y * y, x * i, y * i, i * i];
        for (sum, product) in self.scatter.iter_mut().zip(products) {
            *sum += product * weight;
        }
    }
}

#[inline]
pub(crate) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<[f64; 3]>> {
        prop::collection::vec(
            (-20.0..20.0, -20.0..20.0, 0.0..120.0).prop_map(|(x, y, i)| [x, y, i]),
            0..40,
        )
    }
    fn sum_of(points: &[[f64; 3]]) -> Distribution {
        let mut sum = Distribution::default();
        points.iter().for_each(|p| sum.add(*p));
        sum
    }
    fn close(a: &Distribution, b: &Distribution) -> bool {
        a.count == b.count
            && a.mean.iter().zip(b.mean).all(|(a, b)| (a - b).abs() < 1e-9)
            && a.scatter
                .iter()
                .zip(b.scatter)
                .all(|(a, b)| (a - b).abs() < 1e-6 * (1.0 + b.abs()))
    }

    proptest! {
        #[test]
        fn merging_equals_adding_all_points(a in points(), b in points()) {
            let mut merged = sum_of(&a);
            merged.merge(&sum_of(&b));
            let all: Vec<_> = a.iter().chain(&b).copied().collect();
            prop_assert!(close(&merged, &sum_of(&all)));
        }

        #[test]
        fn it_is_the_textbook_covariance(a in points()) {
            prop_assume!(a.len() > 1);
            let n = a.len() as f64;
            let mean = |k: usize| a.iter().map(|p| p[k]).sum::<f64>() / n;
            let sum = |j: usize, k: usize| a.iter().map(|p| (p[j] - mean(j)) * (p[k] - mean(k))).sum::<f64>();
            let expected = Distribution {
                count: a.len() as u32,
                mean: [mean(0), mean(1), mean(2)],
                scatter: [sum(0, 0), sum(0, 1), sum(1, 1), sum(0, 2), sum(1, 2), sum(2, 2)],
            };
            prop_assert!(close(&sum_of(&a), &expected));
        }
    }
}
