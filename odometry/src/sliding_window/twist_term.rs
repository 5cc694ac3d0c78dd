//! The way by wheels between two neighbouring scans, where the cells do not fix it: it takes the
//! place of what the accelerometer says.

use super::{
    SlidingWindow, block_tridiagonal::BlockTridiagonalSystem, factors::add_row, state::State,
    state::StateVector, window_scan::WindowScan,
};
use nalgebra::Vector3;
use randt_geometry::Pose2;
use randt_persist::persist;

/// The way since the scan before, in the robot's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwistWay {
    /// Forward and to the left, m.
    pub way_m: [f64; 2],
    /// Standard deviations, m.
    pub sigma_m: [f64; 2],
}

persist!(TwistWay { way_m, sigma_m });

/// Adds the way between the state before and the scan at i; gives its cost.
pub fn add(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    previous: &State,
    scan: &WindowScan,
) -> f64 {
    let Some(way) = scan.twist_way() else {
        return 0.0;
    };
    // What is measured is the velocity's mean: the logarithm of the motion.
    let relative = previous.odom_from_base.between(&scan.state.odom_from_base);
    let moved = relative.log();
    let by_current = Pose2::right_jacobian_inverse(moved);
    let by_previous = -by_current * relative.inverse().adjoint();
    let mut cost = 0.0;
    for (axis, (way_m, sigma_m)) in way.way_m.iter().zip(way.sigma_m).enumerate() {
        let (mut a, mut b) = (StateVector::zeros(), StateVector::zeros());
        for k in 0..3 {
            a[k] = by_previous[(axis, k)];
            b[k] = by_current[(axis, k)];
        }
        cost += add_row(system, i, &a, &b, moved[axis] - way_m, sigma_m * sigma_m);
    }
    cost
}

impl SlidingWindow {
    /// The newest scan has a way by wheels, from where it is predicted if its cells do not fix it.
    pub fn predict_by_twist(&mut self, way: Option<TwistWay>) {
        let before = self.used.checked_sub(2);
        let before = before.and_then(|before| self.scans.get(before));
        let Some(last) = before.map(|scan| scan.state) else {
            return;
        };
        let Some(scan) = self.newest_mut() else {
            return;
        };
        scan.twist = way;
        if let Some(way) = scan.twist_way() {
            let [forward_m, left_m] = way.way_m;
            let turn = last.odom_from_base.between(&scan.state.odom_from_base);
            let moved = Pose2::exp(Vector3::new(forward_m, left_m, turn.yaw_rad));
            scan.state.odom_from_base = last.odom_from_base.compose(&moved);
            scan.state.velocity.x = forward_m / scan.dt_s;
            scan.state.velocity.y = left_m / scan.dt_s;
        }
    }

    /// The newest scan shows no standstill, whatever the IMU says: a slow and even drive looks
    /// like one to it.
    pub fn leave_out_standstill(&mut self) {
        let newest = self.newest_mut().and_then(|scan| scan.gyro.as_mut());
        if let Some(gyro) = newest {
            (gyro.standstill, gyro.stands) = (None, false);
        }
    }

    /// The ways by wheels of all scans are wrong.
    pub fn leave_out_twists(&mut self) {
        self.scans.iter_mut().for_each(|scan| scan.twist = None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost_and_system(previous: &State, scan: &WindowScan) -> (f64, BlockTridiagonalSystem) {
        let mut system = BlockTridiagonalSystem::new(2);
        system.reset(2);
        let cost = add(&mut system, 1, previous, scan);
        (cost, system)
    }

    /// A scan that drove on in a curve, with its way by wheels.
    fn pair() -> (State, WindowScan) {
        let previous = State {
            odom_from_base: Pose2::new(3.0, -2.0, 0.7),
            ..State::default()
        };
        let moved = Pose2::exp(Vector3::new(0.2, 0.01, 0.1));
        let scan = WindowScan {
            state: State {
                odom_from_base: previous.odom_from_base.compose(&moved),
                ..State::default()
            },
            dt_s: 0.2,
            twist: Some(TwistWay {
                way_m: [0.2, 0.01],
                sigma_m: [0.01, 0.02],
            }),
            ..WindowScan::default()
        };
        (previous, scan)
    }

    #[test]
    fn a_way_costs_what_it_differs_by_where_cells_do_not_fix_it() {
        let (previous, mut scan) = pair();
        assert!(cost_and_system(&previous, &scan).0 < 1e-20);
        let step = StateVector::from_column_slice(&[0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        scan.state = scan.state.plus(&step);
        assert!((cost_and_system(&previous, &scan).0 - 0.5).abs() < 0.01);
        scan.fixes_way = true;
        assert_eq!(cost_and_system(&previous, &scan).0, 0.0);
    }

    #[test]
    fn gradients_are_the_derivatives_of_the_cost() {
        let (previous, mut scan) = pair();
        let step = StateVector::from_column_slice(&[0.01, -0.02, 0.03, 0.0, 0.0, 0.0, 0.0]);
        scan.state = scan.state.plus(&step);
        let (_, system) = cost_and_system(&previous, &scan);
        for axis in 0..3 {
            let mut d = StateVector::zeros();
            d[axis] = 1e-6;
            let cost = |previous: &State, state: State| {
                let scan = WindowScan {
                    state,
                    ..scan.clone()
                };
                cost_and_system(previous, &scan).0
            };
            let by_previous =
                cost(&previous.plus(&d), scan.state) - cost(&previous.plus(&-d), scan.state);
            let by_current =
                cost(&previous, scan.state.plus(&d)) - cost(&previous, scan.state.plus(&-d));
            for (i, difference) in [(0, by_previous), (1, by_current)] {
                let (analytic, slope) = (system.gradient(i)[axis], difference / 2e-6);
                assert!(
                    (analytic - slope).abs() < 1e-3 * (1.0 + slope.abs()),
                    "{i} {axis}: {analytic} {slope}"
                );
            }
        }
    }
}
