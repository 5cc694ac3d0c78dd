//! Poses and matrices as plain numbers in a snapshot, to the last bit.

/// A pose as (x, y, yaw).
pub(crate) mod pose {
    use randt_geometry::{Pose2, elementary::PI};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(pose: &Pose2, to: S) -> Result<S::Ok, S::Error> {
        pose.to_array().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Pose2, D::Error> {
        <[f64; 3]>::deserialize(from).map(of)
    }

    /// The pose that gives these numbers.
    pub(crate) fn of([x_m, y_m, yaw_rad]: [f64; 3]) -> Pose2 {
        let pose = Pose2::new(x_m, y_m, yaw_rad);
        // The last heading before half a turn is only made from one turn less: wrapped again it rounds to the other end.
        match pose.yaw_rad.to_bits() == yaw_rad.to_bits() {
            true => pose,
            false => Pose2::new(x_m, y_m, yaw_rad - 2.0 * PI),
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use proptest::prelude::*;

        fn comes_back(pose: Pose2) {
            let again = of(pose.to_array());
            let bits = |pose: Pose2| {
                let (cos, sin) = pose.cos_sin();
                [pose.x_m, pose.y_m, pose.yaw_rad, cos, sin].map(f64::to_bits)
            };
            assert_eq!(bits(again), bits(pose), "{pose:?}");
        }

        proptest! {
            #[test]
            fn poses_come_back(x: f64, y: f64, yaw in -20.0..20.0_f64, steps in -64..64_i64) {
                comes_back(Pose2::new(x, y, yaw));
                // Around the cut of the angle, bit by bit.
                for end in [PI, -PI, 3.0 * PI, -3.0 * PI, 0.0] {
                    let bits = end.to_bits().wrapping_add(steps as u64);
                    comes_back(Pose2::new(x, y, f64::from_bits(bits)));
                }
            }
        }
    }
}

/// A matrix, column by column.
pub(crate) mod matrix {
    use nalgebra::Matrix3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        matrix: &Matrix3<f64>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let columns: [[f64; 3]; 3] = matrix.data.0;
        columns.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Matrix3<f64>, D::Error> {
        <[[f64; 3]; 3]>::deserialize(from).map(Matrix3::from)
    }
}
