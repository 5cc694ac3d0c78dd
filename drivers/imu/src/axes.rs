//! Which axes of the device are x, y and z of the IMU.

use crate::Error;

/// A signed permutation of axes, written like `+x -y +z`: the device's axes that are x, y and z of
/// the IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    rows: [(usize, f64); 3],
}

impl Axes {
    /// Reads the value of a key of the configuration.
    pub fn read(key: &'static str, text: &str) -> Result<Self, Error> {
        let expected = "three different axes with their signs, such as \"+x +y +z\"";
        let axes: Option<Vec<(usize, f64)>> = text.split_whitespace().map(axis).collect();
        let rows: Option<[(usize, f64); 3]> = axes.and_then(|axes| axes.try_into().ok());
        let all = rows.filter(|rows| (0..3).all(|axis| rows.iter().any(|row| row.0 == axis)));
        all.map(|rows| Self { rows })
            .ok_or_else(|| Error::new(key, text, expected))
    }

    /// The same for rates: a mirror image would turn left into right.
    pub fn read_for_rates(key: &'static str, text: &str) -> Result<Self, Error> {
        let axes = Self::read(key, text)?;
        if axes.mirrors() {
            let expected = "right-handed: a mirror image turns left into right; change one sign";
            return Err(Error::new(key, text, expected));
        }
        Ok(axes)
    }

    /// Whether it is a mirror image: its determinant is -1.
    pub fn mirrors(&self) -> bool {
        let [(x, sx), (y, sy), (z, sz)] = self.rows;
        let even = matches!((x, y, z), (0, 1, 2) | (1, 2, 0) | (2, 0, 1));
        (sx * sy * sz > 0.0) != even
    }

    /// Device axes to the IMU's.
    pub fn map(&self, device: [f64; 3]) -> [f64; 3] {
        self.rows.map(|(axis, sign)| {
            // `axis` is below 3.
            sign * device.get(axis).copied().unwrap_or_default()
        })
    }
}

fn axis(text: &str) -> Option<(usize, f64)> {
    let (sign, name) = match text.strip_prefix('-') {
        Some(name) => (-1.0, name),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = ["x", "y", "z"].iter().position(|axis| *axis == name)?;
    Some((axis, sign))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_mapped() {
        for (text, mapped, mirrors) in [
            ("+x +y +z", [1.0, 2.0, 3.0], false),
            ("x y z", [1.0, 2.0, 3.0], false),
            ("-x -y -z", [-1.0, -2.0, -3.0], true),
            ("+y +x -z", [2.0, 1.0, -3.0], false),
            ("+x -y -z", [1.0, -2.0, -3.0], false),
            ("+z +x +y", [3.0, 1.0, 2.0], false),
            ("+y +x +z", [2.0, 1.0, 3.0], true),
        ] {
            let axes = Axes::read("acceleration_axes", text).unwrap();
            assert_eq!(axes.map([1.0, 2.0, 3.0]), mapped, "{text}");
            assert_eq!(axes.mirrors(), mirrors, "{text}");
            assert_eq!(Axes::read_for_rates("rate_axes", text).is_err(), mirrors);
        }
    }

    #[test]
    fn what_is_no_signed_permutation_is_refused() {
        for text in [
            "",
            "+x +y",
            "+x +x +z",
            "+x +y +z +x",
            "+a +y +z",
            "++x +y +z",
            "+x+y+z",
        ] {
            let error = Axes::read("rate_axes", text).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("imu.rate_axes is {text:?}")),
                "{error}"
            );
        }
    }
}
