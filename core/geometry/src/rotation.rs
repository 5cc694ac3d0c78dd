//! Time against angle of a turning sensor: what a turntable of constant speed would have, by least
//! squares.
//!
//! Stamps of beams come in bursts of up to 16 ms (Navtech); the turntable's speed is far steadier
//! than that.

/// A line through (counts, time).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    first: i64,
    ns_per_unit: i64,
    offset: f64,
    per_count: f64,
}

impl Rotation {
    /// Fits rows of (counts of the encoder, over its zero; stamp). Counts are of any encoder;
    /// stamps have units of `ns_per_unit` ns and are taken relative to `first`, one of them.
    /// Without two different counts it stands still.
    pub fn fit(
        rows: impl Iterator<Item = (i64, i64)> + Clone,
        first: i64,
        ns_per_unit: i64,
    ) -> Self {
        let count = rows.clone().count().max(1) as f64;
        let relative = || {
            rows.clone()
                .map(|(u, t)| (u as f64, t.wrapping_sub(first) as f64))
        };
        let mean_u = relative().map(|(u, _)| u).sum::<f64>() / count;
        let mean_t = relative().map(|(_, t)| t).sum::<f64>() / count;
        let (mut product, mut square) = (0.0, 0.0);
        for (u, t) in relative() {
            product += (u - mean_u) * (t - mean_t);
            square += (u - mean_u) * (u - mean_u);
        }
        let per_count = if square > 0.0 { product / square } else { 0.0 };
        Self {
            first,
            ns_per_unit,
            offset: mean_t - per_count * mean_u,
            per_count,
        }
    }

    /// When the encoder was at this count, ns.
    pub fn ns(&self, counts: f64) -> i64 {
        let relative = self.ns_per_unit as f64 * (self.offset + self.per_count * counts);
        self.first
            .saturating_mul(self.ns_per_unit)
            .saturating_add(relative.round() as i64)
    }

    /// How long the encoder takes for this number of counts, ns.
    pub fn duration_ns(&self, counts: f64) -> f64 {
        self.ns_per_unit as f64 * self.per_count * counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bursts_do_not_move_the_line() {
        let rows: Vec<(i64, i64)> = (0..400)
            .map(|row| (row * 14, 1_000 + row * 625 - (row % 8) * 600 + 2100))
            .collect();
        let rotation = Rotation::fit(rows.iter().copied(), 1_000, 1000);
        assert!((rotation.duration_ns(5600.0) - 250e6).abs() < 0.1e6);
        assert!((rotation.ns(2800.0) - 126_000_000).abs() < 50_000);
    }

    #[test]
    fn one_row_stands_still() {
        let rotation = Rotation::fit([(7, 50)].into_iter(), 50, 1);
        assert_eq!(rotation.ns(1000.0), 50);
        assert_eq!(Rotation::fit([].into_iter(), 3, 1).ns(5.0), 3);
    }
}
