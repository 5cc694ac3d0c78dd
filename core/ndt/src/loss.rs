//! The adaptive robust loss (Barron 2019) with graduated scale (RaNDT, III-C).

use wide::f64x4;

/// rho(s) = (b |a-2| / a) ((2 s / (b |a-2|) + 1)^(a/2) - 1) with b = mu c^2 and rho'(0) = 1.
///
/// `s` is a squared distance. The shape is rounded to a multiple of 0.5 below 2, so that the power
/// in the derivative is a multiple of a quarter and needs square roots only: the same bits on
/// every machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveLoss {
    alpha: f64,
    /// 2 / (b |a - 2|).
    slope: f64,
    /// 4 (1 - a / 2): the derivative is (1 + slope s)^(-quarters / 4).
    quarters: u32,
    /// b |a - 2| / a.
    height: f64,
}

impl AdaptiveLoss {
    /// Shape `alpha` < 2, scale `c`, graduation factor `mu` >= 1 on c^2.
    pub fn new(alpha: f64, c: f64, mu: f64) -> Self {
        let alpha = ((alpha * 2.0).round() * 0.5).min(1.5);
        let slope = 2.0 / (mu * c * c * (2.0 - alpha));
        Self {
            alpha,
            slope,
            quarters: (4.0 - 2.0 * alpha) as u32,
            height: 2.0 / (slope * alpha),
        }
    }

    /// rho'(s): the weight of a residual in reweighted least squares.
    #[inline]
    pub fn weight(&self, s: f64) -> f64 {
        let base = 1.0 + self.slope * s;
        let mut power = 1.0;
        for _ in 0..self.quarters / 4 {
            power *= base;
        }
        let root = base.sqrt();
        match self.quarters % 4 {
            1 => power *= root.sqrt(),
            2 => power *= root,
            3 => power *= root * root.sqrt(),
            _ => {}
        }
        1.0 / power
    }

    /// [`AdaptiveLoss::weight`] of four at once.
    #[inline]
    pub fn weight4(&self, s: f64x4) -> f64x4 {
        let base = f64x4::ONE + f64x4::splat(self.slope) * s;
        let mut power = f64x4::ONE;
        for _ in 0..self.quarters / 4 {
            power *= base;
        }
        match self.quarters % 4 {
            1 => power *= base.sqrt().sqrt(),
            2 => power *= base.sqrt(),
            3 => {
                let root = base.sqrt();
                power *= root * root.sqrt();
            }
            _ => {}
        }
        f64x4::ONE / power
    }

    /// rho(s), given its weight at s.
    #[inline]
    pub fn cost(&self, s: f64, weight: f64) -> f64 {
        if self.alpha == 0.0 {
            return 1.0 / self.slope * randt_geometry::elementary::ln(1.0 + self.slope * s);
        }
        // (1 + slope s)^(a/2) is the weight times one more power.
        self.height * (weight * (1.0 + self.slope * s) - 1.0)
    }

    /// [`AdaptiveLoss::cost`] of four at once.
    #[inline]
    pub fn cost4(&self, s: f64x4, weight: f64x4) -> f64x4 {
        if self.alpha == 0.0 {
            let (s, weight) = (s.to_array(), weight.to_array());
            return f64x4::from([0, 1, 2, 3].map(|i| self.cost(s[i], weight[i])));
        }
        f64x4::splat(self.height)
            * (weight * (f64x4::ONE + f64x4::splat(self.slope) * s) - f64x4::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::pow;

    #[test]
    fn it_is_barrons_formula_and_its_derivative() {
        for alpha in [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5] {
            for (c, mu) in [(1.0, 1.0), (2.0, 1.69)] {
                let loss = AdaptiveLoss::new(alpha, c, mu);
                let cost = |s: f64| loss.cost(s, loss.weight(s));
                assert_eq!((cost(0.0), loss.weight(0.0)), (0.0, 1.0));
                for s in [1e-3, 0.5, 3.0, 40.0] {
                    if alpha != 0.0 {
                        let b = mu * c * c * (2.0 - alpha);
                        let expected = b / alpha * (pow(2.0 * s / b + 1.0, alpha / 2.0) - 1.0);
                        assert!((cost(s) - expected).abs() < 1e-10, "alpha {alpha} s {s}");
                    }
                    let h = 1e-5 * s;
                    let slope = (cost(s + h) - cost(s - h)) / (2.0 * h);
                    assert!(
                        (slope - loss.weight(s)).abs() < 1e-6,
                        "alpha {alpha} s {s}: {slope}"
                    );
                    let lanes = loss.weight4(f64x4::from([s, 0.0, 2.0 * s, 7.0])).to_array();
                    assert_eq!(
                        lanes,
                        [loss.weight(s), 1.0, loss.weight(2.0 * s), loss.weight(7.0)]
                    );
                }
            }
        }
    }
}
