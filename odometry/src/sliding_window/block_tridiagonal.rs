//! Normal equations of states in a row: unary terms and terms between neighbours.
//!
//! Their matrix is block tridiagonal. Elimination from the oldest to the newest state is at once
//! the solution, the newest state's covariance and, cut after one step, the marginalisation of the
//! oldest state.

use super::state::{StateMatrix, StateVector};
use nalgebra::{Cholesky, Const};

type Factor = Cholesky<f64, Const<7>>;

/// Normal equations H d = -g of up to a fixed number of states; nothing is allocated after `new`.
#[derive(Clone, Debug, Default)]
pub struct BlockTridiagonalSystem {
    diagonal: Vec<StateMatrix>,
    /// Block (i, i - 1) at i; the first is unused.
    lower: Vec<StateMatrix>,
    gradient: Vec<StateVector>,
    factors: Vec<Factor>,
}

impl BlockTridiagonalSystem {
    /// Room for `states`.
    pub fn new(states: usize) -> Self {
        Self {
            diagonal: Vec::with_capacity(states),
            lower: Vec::with_capacity(states),
            gradient: Vec::with_capacity(states),
            factors: Vec::with_capacity(states),
        }
    }

    /// Empties it and makes it `states` long.
    pub fn reset(&mut self, states: usize) {
        for blocks in [&mut self.diagonal, &mut self.lower] {
            blocks.clear();
            blocks.resize(states, StateMatrix::zeros());
        }
        self.gradient.clear();
        self.gradient.resize(states, StateVector::zeros());
    }

    /// Adds a term of one state: information and gradient.
    pub fn add_unary(&mut self, i: usize, information: &StateMatrix, gradient: &StateVector) {
        if let (Some(d), Some(g)) = (self.diagonal.get_mut(i), self.gradient.get_mut(i)) {
            *d += information;
            *g += gradient;
        }
    }

    /// Adds a scalar residual between state i - 1 and state i: rows of its Jacobian by both, its
    /// value, its information.
    pub fn add_row(
        &mut self,
        i: usize,
        previous: &StateVector,
        current: &StateVector,
        residual: f64,
        information: f64,
    ) {
        let Some(before) = i.checked_sub(1) else {
            return;
        };
        if let Some(d) = self.diagonal.get_mut(before) {
            *d += previous * previous.transpose() * information;
        }
        if let (Some(d), Some(l)) = (self.diagonal.get_mut(i), self.lower.get_mut(i)) {
            *d += current * current.transpose() * information;
            *l += current * previous.transpose() * information;
        }
        if let Some(g) = self.gradient.get_mut(before) {
            *g += previous * (residual * information);
        }
        if let Some(g) = self.gradient.get_mut(i) {
            *g += current * (residual * information);
        }
    }

    /// Gradient of one state's terms.
    #[cfg(test)]
    pub fn gradient(&self, i: usize) -> StateVector {
        self.gradient[i]
    }

    /// Solves H d = -g into `steps`; gives the newest state's marginal covariance.
    ///
    /// `None` where H is not positive definite; `steps` must then not be used.
    pub fn solve(&mut self, steps: &mut Vec<StateVector>) -> Option<StateMatrix> {
        self.factors.clear();
        steps.clear();
        let (mut diagonal, mut gradient) = (*self.diagonal.first()?, *self.gradient.first()?);
        for i in 0..self.diagonal.len() {
            if i > 0 {
                (diagonal, gradient) = self.eliminate(
                    i,
                    *self.diagonal.get(i)?,
                    *self.gradient.get(i)?,
                    steps.last()?,
                )?;
            }
            self.factors.push(Factor::new(diagonal)?);
            steps.push(gradient);
        }
        let covariance = self.factors.last()?.inverse();
        // Backwards: d_i = -D_i^-1 (g_i + L_(i+1)^T d_(i+1)).
        let mut next: Option<(StateVector, StateMatrix)> = None;
        for i in (0..steps.len()).rev() {
            let step = steps.get_mut(i)?;
            if let Some((d, lower)) = next {
                *step += lower.transpose() * d;
            }
            *step = -self.factors.get(i)?.solve(step);
            next = Some((*step, *self.lower.get(i)?));
        }
        Some(covariance)
    }

    /// Marginalises the first of two states: information and gradient that its terms give the
    /// second.
    ///
    /// To be called on a system of two states that holds just the terms which leave with the first
    /// one.
    pub fn marginal_of_second(&mut self) -> Option<(StateMatrix, StateVector)> {
        self.factors.clear();
        self.factors.push(Factor::new(*self.diagonal.first()?)?);
        let first = *self.gradient.first()?;
        self.eliminate(1, *self.diagonal.get(1)?, *self.gradient.get(1)?, &first)
    }

    /// Schur complement of state i - 1 in state i.
    fn eliminate(
        &self,
        i: usize,
        diagonal: StateMatrix,
        gradient: StateVector,
        previous_gradient: &StateVector,
    ) -> Option<(StateMatrix, StateVector)> {
        let lower = self.lower.get(i)?;
        let factor = self.factors.get(i - 1)?;
        let mut reduced = diagonal - lower * factor.solve(&lower.transpose());
        // Rounding leaves it slightly asymmetric; Cholesky reads one half only, the prior both.
        reduced = (reduced + reduced.transpose()) * 0.5;
        Some((reduced, gradient - lower * factor.solve(previous_gradient)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;

    /// Random rows between three states, with priors.
    fn system(
        values: &[f64],
    ) -> (
        BlockTridiagonalSystem,
        SMatrix<f64, 21, 21>,
        SVector<f64, 21>,
    ) {
        let mut system = BlockTridiagonalSystem::new(3);
        system.reset(3);
        let (mut h, mut g) = (SMatrix::<f64, 21, 21>::zeros(), SVector::<f64, 21>::zeros());
        for (i, value) in values.iter().take(3).enumerate() {
            let (d, e) = (
                StateMatrix::identity() * (1.0 + i as f64),
                StateVector::repeat(*value),
            );
            system.add_unary(i, &d, &e);
            h.view_mut((7 * i, 7 * i), (7, 7)).copy_from(&d);
            g.rows_mut(7 * i, 7).copy_from(&e);
        }
        let mut rows = values.chunks_exact(15);
        for i in [1, 1, 2, 2, 2] {
            let row = rows.next().unwrap();
            let (a, b) = (
                StateVector::from_column_slice(&row[..7]),
                StateVector::from_column_slice(&row[7..14]),
            );
            system.add_row(i, &a, &b, row[14], 2.0);
            let mut j = SVector::<f64, 21>::zeros();
            j.rows_mut(7 * (i - 1), 7).copy_from(&a);
            j.rows_mut(7 * i, 7).copy_from(&b);
            h += j * j.transpose() * 2.0;
            g += j * (row[14] * 2.0);
        }
        (system, h, g)
    }

    proptest! {
        #[test]
        fn it_solves_as_a_dense_solver_does(values in prop::collection::vec(-3.0..3.0f64, 75)) {
            let (mut system, h, g) = system(&values);
            let mut steps = Vec::new();
            let covariance = system.solve(&mut steps).unwrap();
            let dense = h.cholesky().unwrap();
            let expected = dense.solve(&-g);
            for (i, step) in steps.iter().enumerate() {
                prop_assert!((step - expected.fixed_rows::<7>(7 * i)).norm() < 1e-8 * (1.0 + expected.norm()));
            }
            prop_assert!((covariance - dense.inverse().view((14, 14), (7, 7))).norm() < 1e-8);
        }

        #[test]
        fn the_marginal_of_the_first_state_gives_the_same_solution_for_the_others(values in prop::collection::vec(-3.0..3.0f64, 75)) {
            let (mut system, ..) = system(&values);
            let mut pair = BlockTridiagonalSystem::new(2);
            pair.reset(2);
            pair.diagonal.copy_from_slice(&system.diagonal[..2]);
            pair.lower.copy_from_slice(&system.lower[..2]);
            pair.gradient.copy_from_slice(&system.gradient[..2]);
            let (mut whole, mut parts) = (Vec::new(), Vec::new());
            system.solve(&mut whole).unwrap();
            let (information, gradient) = pair.marginal_of_second().unwrap();
            // The second and third state alone, with the marginal of the first one.
            let mut rest = BlockTridiagonalSystem::new(2);
            rest.reset(2);
            rest.diagonal.copy_from_slice(&[information, system.diagonal[2]]);
            rest.lower[1] = system.lower[2];
            rest.gradient.copy_from_slice(&[gradient, system.gradient[2]]);
            rest.solve(&mut parts).unwrap();
            prop_assert!((whole[1] - parts[0]).norm() + (whole[2] - parts[1]).norm() < 1e-7);
        }
    }
}
