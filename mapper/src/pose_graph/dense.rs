//! Small dense systems: the Cholesky factor of a symmetric matrix, row by row.

use super::system::DOF;

/// A square matrix, of which the lower triangle counts.
#[derive(Clone, Debug)]
pub(super) struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Dense {
    /// Zero.
    pub fn zeros(size: usize) -> Self {
        let values = vec![0.0; size * size];
        Self { size, values }
    }

    /// How many rows it has.
    pub fn size(&self) -> usize {
        self.size
    }

    /// A row up to the diagonal.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.size..=row * self.size + row]
    }

    /// An element of the lower triangle.
    pub fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[row * self.size + column]
    }

    /// The lower triangle whose square it is; `None` where it is not positive definite.
    pub fn cholesky(mut self) -> Option<Self> {
        for i in 0..self.size {
            for j in 0..=i {
                let [a, b] = [i, j].map(|row| &self.row(row)[..j]);
                let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let left = *self.at(i, j) - sum;
                if i > j {
                    *self.at(i, j) = left / *self.at(j, j);
                } else if left > 0.0 && left.is_finite() {
                    *self.at(i, i) = left.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(self)
    }

    /// Solves L x = right in place, three columns at once, where it is such a triangle.
    pub fn solve(&self, right: &mut [[f64; DOF]]) {
        for i in 0..self.size {
            let (known, rest) = right.split_at_mut(i);
            let [own, ..] = rest else { return };
            let row = self.row(i);
            for (factor, known) in row.iter().zip(known.iter()) {
                (0..DOF).for_each(|column| own[column] -= factor * known[column]);
            }
            own.iter_mut().for_each(|value| *value /= row[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(rows: [[f64; 3]; 3]) -> Dense {
        let values = rows.concat();
        Dense { size: 3, values }
    }

    #[test]
    fn the_factor_solves_the_system() {
        // L = [2; 1 3; -1 2 1].
        let square = dense([[4.0, 0.0, 0.0], [2.0, 10.0, 0.0], [-2.0, 5.0, 6.0]]);
        let factor = square.cholesky().unwrap();
        assert_eq!(factor.row(0), [2.0]);
        assert_eq!(factor.row(1), [1.0, 3.0]);
        assert_eq!(factor.row(2), [-1.0, 2.0, 1.0]);
        let mut right = [[2.0, 4.0, 0.0], [4.0, 2.0, 3.0], [2.0, -2.0, 3.0]];
        factor.solve(&mut right);
        assert_eq!(right, [[1.0, 2.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]);
    }

    #[test]
    fn what_is_not_positive_definite_has_none() {
        let indefinite = [[1.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(dense(indefinite).cholesky().is_none());
        let broken = [[f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(dense(broken).cholesky().is_none());
    }
}
