//! The factors between neighbouring states: motion model, gyro, bias (RaNDT, III-C), wheels.

use super::{
    block_tridiagonal::BlockTridiagonalSystem,
    state::{State, StateVector},
    twist_term,
    window_scan::WindowScan,
};
use crate::gyro_integrator::GyroTerm;
use nalgebra::{Matrix3, RowVector3, Vector3};
use randt_config::Odometry;
use randt_geometry::{Pose2, elementary::wrap};

/// Scale error of a MEMS gyro, as a share of the angle turned (data sheets: 0.1-0.5 %).
const GYRO_SCALE_SIGMA: f64 = 0.003;
/// Standard deviation of the heading rate over time without gyro samples, rad/s.
const UNCOVERED_RATE_SIGMA_RAD_S: f64 = 1.0;
/// Noise of a single reading of the yaw rate against the velocity state, rad/s: vibration,
/// quantisation.
const RATE_SIGMA_RAD_S: f64 = 0.02;
/// Speed of a robot that stands, m/s: it may still rock on its springs.
const STANDING_SIGMA_M_S: f64 = 0.01;
/// The heading rate jerks within an interval: floor of the motion model's heading without a gyro,
/// rad.
const HEADING_SIGMA_FLOOR_RAD: f64 = 1e-3;

/// Adds the motion model, the gyro, the bias and the wheels between the state before and the scan
/// at i; gives their cost.
pub fn add(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    previous: &State,
    scan: &WindowScan,
    config: &Odometry,
) -> f64 {
    let (current, dt_s) = (&scan.state, scan.dt_s);
    let motion = motion_model(system, i, previous, scan, config);
    let gyro = scan.gyro.as_ref().map_or(0.0, |gyro| {
        gyro_term(system, i, previous, current, dt_s, gyro, config)
    });
    let change = &scan.bias_change;
    let bias_sigma2 = config.gyro_bias_walk * config.gyro_bias_walk * dt_s + change.variance;
    let (mut a, mut b) = (StateVector::zeros(), StateVector::zeros());
    (a[6], b[6]) = (-1.0, 1.0);
    motion
        + gyro
        + twist_term::add(system, i, previous, scan)
        + add_row(
            system,
            i,
            &a,
            &b,
            current.bias_rad_s - previous.bias_rad_s - change.mean_rad_s,
            bias_sigma2,
        )
}

/// Constant velocity under white acceleration: [Log(That^-1 T), v_t - v_(t-1)], That = T_(t-1)
/// Exp(v dt) with the mean of both velocities, so that a braking vehicle is not dragged.
fn motion_model(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    previous: &State,
    scan: &WindowScan,
    config: &Odometry,
) -> f64 {
    let (current, dt_s) = (&scan.state, scan.dt_s);
    let speed_change = scan.speed_change();
    let twist = (previous.velocity + current.velocity) * (0.5 * dt_s);
    let relative = previous.odom_from_base.between(&current.odom_from_base);
    let error = Pose2::exp(twist).between(&relative);
    let residual = error.log();
    let inverse = Pose2::right_jacobian_inverse(residual);
    let by_previous = -inverse * relative.inverse().adjoint();
    let by_velocity: Matrix3<f64> =
        -inverse * error.inverse().adjoint() * Pose2::right_jacobian(twist) * (0.5 * dt_s);

    let acceleration = Vector3::new(
        config.acceleration_sigma_m_s2,
        config.lateral_acceleration_sigma_m_s2,
        config.angular_acceleration_sigma_rad_s2,
    );
    let mut cost = 0.0;
    for axis in 0..3 {
        // White acceleration of density a^2 dt over dt: velocity varies by a dt, position around
        // the mean of the velocities by a dt^2 / sqrt 12.
        let (mut velocity_change, mut velocity_sigma) = (0.0, acceleration[axis] * dt_s);
        if let Some(measured) = speed_change
            && let (Some(value), Some(sigma)) =
                (measured.value_m_s.get(axis), measured.sigma_m_s.get(axis))
        {
            (velocity_change, velocity_sigma) = (*value, *sigma);
        }
        let mut position_sigma2 = velocity_sigma * velocity_sigma * dt_s * dt_s / 12.0;
        if axis == 2 && scan.gyro.is_none() {
            position_sigma2 += HEADING_SIGMA_FLOOR_RAD * HEADING_SIGMA_FLOOR_RAD;
        }
        let (mut a, mut b) = (StateVector::zeros(), StateVector::zeros());
        let set = |row: &mut StateVector, at: usize, values: RowVector3<f64>| {
            (0..3).for_each(|k| row[at + k] = values[k])
        };
        set(&mut a, 0, by_previous.row(axis).into_owned());
        set(&mut a, 3, by_velocity.row(axis).into_owned());
        set(&mut b, 0, inverse.row(axis).into_owned());
        set(&mut b, 3, by_velocity.row(axis).into_owned());
        cost += add_row(system, i, &a, &b, residual[axis], position_sigma2);

        let (mut a, mut b) = (StateVector::zeros(), StateVector::zeros());
        (a[3 + axis], b[3 + axis]) = (-1.0, 1.0);
        cost += add_row(
            system,
            i,
            &a,
            &b,
            current.velocity[axis] - previous.velocity[axis] - velocity_change,
            velocity_sigma * velocity_sigma,
        );
    }
    if let Some(seen) = scan.last_seen_speed() {
        for (axis, (value, sigma)) in seen.value_m_s.iter().zip(seen.sigma_m_s).enumerate() {
            let (a, mut b) = (StateVector::zeros(), StateVector::zeros());
            b[3 + axis] = 1.0;
            let residual = current.velocity[axis] - value;
            cost += add_row(system, i, &a, &b, residual, sigma * sigma);
        }
    }
    if scan.stands() {
        for axis in 0..2 {
            let (a, mut b) = (StateVector::zeros(), StateVector::zeros());
            b[3 + axis] = 1.0;
            let sigma2 = STANDING_SIGMA_M_S * STANDING_SIGMA_M_S;
            cost += add_row(system, i, &a, &b, current.velocity[axis], sigma2);
        }
    }
    cost
}

/// Log((R_(t-1) dR Exp(-b dt))^-1 R_t), and the rate at the scan itself.
fn gyro_term(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    previous: &State,
    current: &State,
    dt_s: f64,
    gyro: &GyroTerm,
    config: &Odometry,
) -> f64 {
    let turned = wrap(current.odom_from_base.yaw_rad - previous.odom_from_base.yaw_rad);
    let bias = 0.5 * (previous.bias_rad_s + current.bias_rad_s);
    let residual = wrap(turned - gyro.turn.angle_rad + bias * dt_s);
    let scale = GYRO_SCALE_SIGMA * gyro.turn.angle_rad;
    let uncovered = UNCOVERED_RATE_SIGMA_RAD_S * gyro.turn.uncovered_s;
    let noise2 = config.gyro_noise_rad_s_sqrt_hz * config.gyro_noise_rad_s_sqrt_hz * dt_s;
    let (mut a, mut b) = (StateVector::zeros(), StateVector::zeros());
    (a[2], b[2]) = (-1.0, 1.0);
    (a[6], b[6]) = (0.5 * dt_s, 0.5 * dt_s);
    let cost = add_row(
        system,
        i,
        &a,
        &b,
        residual,
        noise2 + scale * scale + uncovered * uncovered,
    );

    let (a, mut b) = (StateVector::zeros(), StateVector::zeros());
    (b[5], b[6]) = (1.0, 1.0);
    let residual = current.velocity.z - gyro.rate_rad_s + current.bias_rad_s;
    let cost = cost
        + add_row(
            system,
            i,
            &a,
            &b,
            residual,
            RATE_SIGMA_RAD_S * RATE_SIGMA_RAD_S + uncovered * uncovered,
        );

    gyro.standstill.map_or(cost, |(bias_rad_s, sigma_rad_s)| {
        b[5] = 0.0;
        cost + add_row(
            system,
            i,
            &a,
            &b,
            current.bias_rad_s - bias_rad_s,
            sigma_rad_s * sigma_rad_s,
        )
    })
}

/// Adds a residual of one number; gives its cost.
pub fn add_row(
    system: &mut BlockTridiagonalSystem,
    i: usize,
    a: &StateVector,
    b: &StateVector,
    residual: f64,
    sigma2: f64,
) -> f64 {
    let information = 1.0 / sigma2;
    system.add_row(i, a, b, residual, information);
    0.5 * residual * residual * information
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gyro_integrator::Turn;
    use proptest::prelude::*;

    fn state() -> impl Strategy<Value = State> {
        (
            (-5.0..5.0, -5.0..5.0, -3.1..3.1),
            (-1.0..9.0, -0.3..0.3, -0.8..0.8),
            -0.02..0.02,
        )
            .prop_map(|((x, y, yaw), (vx, vy, w), bias_rad_s)| State {
                odom_from_base: Pose2::new(x, y, yaw),
                velocity: Vector3::new(vx, vy, w),
                bias_rad_s,
            })
    }

    fn cost_and_system(previous: &State, scan: &WindowScan) -> (f64, BlockTridiagonalSystem) {
        let mut system = BlockTridiagonalSystem::new(2);
        system.reset(2);
        let cost = add(&mut system, 1, previous, scan, &Odometry::default());
        (cost, system)
    }

    proptest! {
        #[test]
        fn gradients_are_the_derivatives_of_the_cost(previous in state(), error in prop::array::uniform7(-0.05..0.05f64), gyro in any::<bool>()) {
            // The newer state is near where the older one leads, as it is in every window.
            let dt_s = 0.2;
            let led = State { odom_from_base: previous.odom_from_base.compose(&Pose2::exp(previous.velocity * dt_s)), ..previous };
            let term = GyroTerm {
                turn: Turn { angle_rad: previous.velocity.z * dt_s + 0.01, uncovered_s: 0.0 },
                rate_rad_s: previous.velocity.z,
                standstill: Some((0.001, 0.002)), ..GyroTerm::default()
            };
            let scan = WindowScan { state: led.plus(&StateVector::from(error)), dt_s, gyro: gyro.then_some(term), ..WindowScan::default() };
            let (_, system) = cost_and_system(&previous, &scan);
            let h = 1e-6;
            for axis in 0..7 {
                let mut d = StateVector::zeros();
                d[axis] = h;
                let by_previous = (cost_and_system(&previous.plus(&d), &scan).0 - cost_and_system(&previous.plus(&-d), &scan).0) / (2.0 * h);
                let moved = |d: &StateVector| WindowScan { state: scan.state.plus(d), ..scan.clone() };
                let by_current = (cost_and_system(&previous, &moved(&d)).0 - cost_and_system(&previous, &moved(&-d)).0) / (2.0 * h);
                for (i, slope) in [(0, by_previous), (1, by_current)] {
                    let analytic = system.gradient(i)[axis];
                    let scale = 1.0 + slope.abs() + system.gradient(i).norm();
                    prop_assert!((analytic - slope).abs() < 1e-3 * scale, "state {i} axis {axis}: {analytic} {slope}");
                }
            }
        }
    }
}
