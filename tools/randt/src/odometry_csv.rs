//! `odometry.csv`: what odometry published of each scan, as a table.

use randt_messages::{Localizability, OdometryState};
use std::fmt::Write;

const COLUMNS: &str = "stamp_ns,odom_frame,x_m,y_m,yaw_rad,trust,cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,weak_direction_rad,vx_m_s,vy_m_s,yaw_rate_rad_s,gyro_bias_rad_s,cells,fit";

/// One row a state. A number is the shortest one that is read back to the same bits.
pub fn odometry_csv(states: &[OdometryState]) -> String {
    let mut text = format!("{COLUMNS}\n");
    for state in states {
        let [x_m, y_m, yaw_rad] = state.pose;
        let [xx, xy, xyaw, _, yy, yyaw, _, _, yawyaw] = state.covariance;
        let [vx_m_s, vy_m_s, yaw_rate_rad_s] = state.velocity;
        let [_, _, gyro_bias_rad_s] = state.gyro_bias_rad_s;
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{},{},{x_m},{y_m},{yaw_rad},{},{xx},{xy},{xyaw},{yy},{yyaw},{yawyaw},{},{vx_m_s},{vy_m_s},{yaw_rate_rad_s},{gyro_bias_rad_s},{},{}",
            state.header.stamp_ns,
            state.odom_frame_id,
            state.trust().as_str(),
            weak_direction(state),
            state.cells,
            state.fit
        );
    }
    text
}

fn weak_direction(state: &OdometryState) -> String {
    match state.localizability() {
        Localizability::Partial => state.weak_direction_rad.to_string(),
        Localizability::None => "all".to_owned(),
        Localizability::Full | Localizability::Unknown => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Trust;

    /// Another value in each field; none of them has a short decimal form.
    fn state() -> OdometryState {
        let mut state = OdometryState {
            odom_frame_id: 3,
            pose: [0.1 + 0.2, -1e-17, 1.0 / 3.0],
            velocity: [1.0 / 7.0, -1.0 / 11.0, 1.0 / 13.0],
            gyro_bias_rad_s: [1.0, 2.0, -1.0 / 17.0],
            covariance: [4.0, 0.1, 0.2, 0.1, 1e6 / 3.0, 0.3, 0.2, 0.3, 6.0].map(|v| v / 19.0),
            weak_direction_rad: -1.0 / 23.0,
            fit: 1.0 / 29.0,
            trust: Trust::Degraded as u32,
            localizability: Localizability::Partial as u32,
            cells: 31,
            ..OdometryState::default()
        };
        state.header.stamp_ns = 1_700_000_000_000_000_123;
        state
    }

    #[test]
    fn a_row_has_every_value_to_the_last_bit() {
        let state = state();
        let text = odometry_csv(&[state]);
        let [head, row] = text.lines().collect::<Vec<_>>()[..] else {
            panic!("{text}");
        };
        let names = head.split(',');
        let values = std::collections::BTreeMap::from_iter(names.zip(row.split(',')));
        assert_eq!(values.len(), 19);
        assert_eq!(values["stamp_ns"], "1700000000000000123");
        assert_eq!((values["odom_frame"], values["cells"]), ("3", "31"));
        assert_eq!(values["trust"], "degraded");
        let c = state.covariance;
        for (name, expected) in [
            ("x_m", state.pose[0]),
            ("y_m", state.pose[1]),
            ("yaw_rad", state.pose[2]),
            ("cov_xx", c[0]),
            ("cov_xy", c[1]),
            ("cov_xyaw", c[2]),
            ("cov_yy", c[4]),
            ("cov_yyaw", c[5]),
            ("cov_yawyaw", c[8]),
            ("weak_direction_rad", state.weak_direction_rad),
            ("vx_m_s", state.velocity[0]),
            ("vy_m_s", state.velocity[1]),
            ("yaw_rate_rad_s", state.velocity[2]),
            ("gyro_bias_rad_s", state.gyro_bias_rad_s[2]),
            ("fit", state.fit),
        ] {
            let value: f64 = values[name].parse().unwrap();
            assert_eq!(value.to_bits(), expected.to_bits(), "{name}");
        }
    }

    #[test]
    fn the_weak_direction_is_empty_where_there_is_none() {
        for (localizability, expected) in [
            (Localizability::Unknown, ""),
            (Localizability::Full, ""),
            (Localizability::None, "all"),
        ] {
            let mut state = state();
            state.localizability = localizability as u32;
            let text = odometry_csv(&[state]);
            let row = text.lines().nth(1).unwrap();
            assert_eq!(row.split(',').nth(12), Some(expected));
        }
    }
}
