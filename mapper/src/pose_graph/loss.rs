//! How much an edge may pull when its error grows.

/// The loss of one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Loss {
    /// The squared error with a fixed weight.
    Weighted(f64),
    /// Dynamic covariance scaling, DCS (Agarwal et al. 2013): quadratic up to chi2 = `phi`, then
    /// bounded by 3 phi. Up to phi the weight is exactly 1: good loops give the optimum of the
    /// plain least squares.
    Scaled {
        /// chi2 from which an error is doubted.
        phi: f64,
    },
}

impl Loss {
    /// The plain squared error.
    pub const QUADRATIC: Self = Self::Weighted(1.0);

    /// What an error of this chi2 costs.
    pub fn cost(self, chi2: f64) -> f64 {
        match self {
            Self::Weighted(weight) => weight * chi2,
            Self::Scaled { phi } if chi2 > phi => phi * (3.0 * chi2 - phi) / (phi + chi2),
            Self::Scaled { .. } => chi2,
        }
    }

    /// The weight of the squared error that has the same slope: d cost / d chi2.
    pub fn weight(self, chi2: f64) -> f64 {
        match self {
            Self::Weighted(weight) => weight,
            Self::Scaled { phi } if chi2 > phi => {
                let s = 2.0 * phi / (phi + chi2);
                s * s
            }
            Self::Scaled { .. } => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Loss;

    #[test]
    fn the_weight_is_the_slope_of_the_cost() {
        let loss = Loss::Scaled { phi: 4.0 };
        for chi2 in [0.5, 3.9, 4.1, 30.0, 1e4] {
            let step = 1e-5 * chi2;
            let slope = (loss.cost(chi2 + step) - loss.cost(chi2 - step)) / (2.0 * step);
            assert!((slope - loss.weight(chi2)).abs() < 1e-6, "{chi2}");
        }
        assert_eq!(loss.weight(4.0), 1.0);
        assert!(loss.cost(1e9) < 12.0 && loss.weight(1e9) < 1e-15);
    }
}
