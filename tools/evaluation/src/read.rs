//! Trajectory files: TUM rows (stamp x y z qx qy qz qw) and KITTI rows (3 x 4 matrix, row by row).
//!
//! The format follows from the first row. A comment `# odom_frame_id N` begins a new frame.

use crate::trajectory::TrajectoryPose;
use crate::{Error, Trajectory, Transform};
use randt_geometry::{Pose2, elementary};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};

/// How a frame is announced, behind the `#`.
pub(crate) const FRAME_MARK: &str = "odom_frame_id";
/// No row is longer; a file without line ends is something else.
const LINE_BYTES_MAX: u64 = 1 << 16;
/// Nor is any table of true poses: an hour of a thousand rows a second has a tenth of this.
const TABLE_BYTES_MAX: u64 = 2 << 30;
/// Nothing on Earth is farther, m; what is comes from a broken file.
pub(crate) const POSITION_MAX_M: f64 = 1e8;
/// Six printed digits keep a rotation to 1e-5; what is off by more is none.
const RIGID_TOLERANCE: f64 = 0.05;

impl Trajectory {
    /// Reads a file.
    pub fn read(path: &str) -> Result<Self, Error> {
        let io = |source| Error::Io {
            path: path.to_owned(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let mut input = BufReader::new(file);
        let begin = input.fill_buf().map_err(io)?;
        let first_line = begin.split(|byte| *byte == b'\n').next();
        if first_line.is_some_and(|line| line.contains(&b',') && !line.starts_with(b"#")) {
            let mut bytes = Vec::new();
            let read = input.take(TABLE_BYTES_MAX).read_to_end(&mut bytes);
            read.map_err(io)?;
            return crate::table::read(&String::from_utf8_lossy(&bytes), path);
        }
        Self::read_from(input, path)
    }

    /// Reads rows; `path` is for messages.
    pub fn read_from(mut input: impl BufRead, path: &str) -> Result<Self, Error> {
        let mut trajectory = None;
        let mut frame = 0;
        let mut bytes = Vec::new();
        for line in 1.. {
            let refuse = |problem| Error::Row {
                path: path.to_owned(),
                line,
                problem,
            };
            bytes.clear();
            let count = input
                .by_ref()
                .take(LINE_BYTES_MAX)
                .read_until(b'\n', &mut bytes)
                .map_err(|source| Error::Io {
                    path: path.to_owned(),
                    source,
                })?;
            if count == 0 {
                break;
            }
            if count as u64 == LINE_BYTES_MAX {
                return Err(refuse("longer than 64 KiB; a row is a line".to_owned()));
            }
            let text = str::from_utf8(&bytes)
                .map_err(|_| refuse("not text; a row is numbers in ASCII".to_owned()))?
                .trim();
            if let Some(comment) = text.strip_prefix('#') {
                frame = frame_mark(comment).map_err(refuse)?.unwrap_or(frame);
            } else if !text.is_empty() {
                let cells: Vec<&str> = text.split_ascii_whitespace().collect();
                let (stamp, transform, left_out) = parse_row(&cells).map_err(refuse)?;
                let trajectory = trajectory.get_or_insert_with(|| match stamp {
                    Some(_) => Self::stamped(),
                    None => Self::unstamped(),
                });
                let pose = TrajectoryPose {
                    stamp_ns: stamp.unwrap_or(0),
                    frame,
                    transform,
                };
                trajectory.accept(pose, stamp.is_some()).map_err(refuse)?;
                trajectory.leave_out(left_out);
            }
        }
        let mut trajectory = trajectory.ok_or_else(|| Error::Empty {
            path: path.to_owned(),
        })?;
        // A clock that was set back begins a frame that is earlier.
        trajectory.sort();
        Ok(trajectory)
    }

    /// Adds a row if it goes with those before.
    fn accept(&mut self, pose: TrajectoryPose, stamped: bool) -> Result<(), String> {
        if stamped != self.is_stamped() {
            return Err("TUM rows (8 numbers) and KITTI rows (12) in one file".to_owned());
        }
        if let Some(last) = self.poses().last()
            && stamped
            && pose.frame == last.frame
            && pose.stamp_ns <= last.stamp_ns
        {
            return Err(format!(
                "stamp {} is not after the one before, {}",
                stamp_text(pose.stamp_ns),
                stamp_text(last.stamp_ns)
            ));
        }
        self.push_pose(pose);
        Ok(())
    }
}

/// The frame that a comment announces, if it does.
fn frame_mark(comment: &str) -> Result<Option<u64>, String> {
    let mut words = comment.split_ascii_whitespace();
    if words.next() != Some(FRAME_MARK) {
        return Ok(None);
    }
    let id = words.next().unwrap_or_default();
    match id.parse() {
        Ok(id) => Ok(Some(id)),
        Err(_) => Err(format!("{FRAME_MARK} {id:?} must be a whole number")),
    }
}

/// A row's stamp, where its format has one, its pose, and what a plane leaves out of it.
fn parse_row(cells: &[&str]) -> Result<(Option<i64>, Transform, [f64; 2]), String> {
    match *cells {
        [stamp, ref rest @ ..] if rest.len() == 7 => {
            let stamp_ns = parse_stamp_ns(stamp)
                .ok_or_else(|| format!("stamp {stamp:?} must be seconds, such as 1700000000.25"))?;
            let row: [f64; 7] = numbers(rest)?;
            let [_, _, z_m, x, y, ..] = row;
            // The third component of the z axis.
            let up = 1.0 - 2.0 * (x * x + y * y);
            Ok((Some(stamp_ns), parse_tum(&row)?, [z_m, up]))
        }
        _ if cells.len() == 12 => {
            let row = numbers(cells)?;
            Ok((None, parse_kitti(&row)?, flattened(&row)))
        }
        _ => Err(format!(
            "{} columns; a TUM row has 8 (stamp x y z qx qy qz qw), a KITTI row 12 (3 x 4 matrix)",
            cells.len()
        )),
    }
}

fn numbers<const N: usize>(cells: &[&str]) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (number, cell) in numbers.iter_mut().zip(cells) {
        *number = cell
            .parse()
            .ok()
            .filter(|n: &f64| n.is_finite() && n.abs() <= POSITION_MAX_M)
            .ok_or_else(|| format!("{cell:?} must be a finite number up to {POSITION_MAX_M:e}"))?;
    }
    Ok(numbers)
}

fn parse_tum(&[x_m, y_m, _, x, y, z, w]: &[f64; 7]) -> Result<Transform, String> {
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    if (norm - 1.0).abs() > RIGID_TOLERANCE {
        return Err(format!(
            "quaternion {x} {y} {z} {w} has length {norm}, it must be 1"
        ));
    }
    let yaw_rad = elementary::atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    Ok(Pose2::new(x_m, y_m, yaw_rad).into())
}

/// Height, and how far the z axis points up: 1 in the plane.
pub(crate) fn flattened(m: &[f64; 12]) -> [f64; 2] {
    [m[11], m[10]]
}

pub(crate) fn parse_kitti(m: &[f64; 12]) -> Result<Transform, String> {
    let transform = Transform::from_rows([m[0], m[1], m[3]], [m[4], m[5], m[7]]);
    if transform.is_rigid(RIGID_TOLERANCE) {
        return Ok(transform);
    }
    Err(format!(
        "[{} {}; {} {}] is no rotation in the plane of x and y; a camera's rows (z forward) must be turned first",
        m[0], m[1], m[4], m[5]
    ))
}

/// Seconds with up to nine decimals, exactly; more decimals are cut.
fn parse_stamp_ns(text: &str) -> Option<i64> {
    if text.contains(['e', 'E']) {
        // numpy.savetxt writes stamps so; a double is all that is behind it.
        let stamp_ns = text.parse::<f64>().ok()? * 1e9;
        return (stamp_ns.abs() < 9.2e18).then_some(stamp_ns.round() as i64);
    }
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(fraction) {
        return None;
    }
    let nanos = fraction.bytes().chain(std::iter::repeat(b'0')).take(9);
    let nanos = nanos.fold(0, |sum, digit| sum * 10 + i64::from(digit - b'0'));
    let whole: i64 = whole.parse().ok()?;
    Some(sign * whole.checked_mul(1_000_000_000)?.checked_add(nanos)?)
}

/// Seconds with nine decimals.
pub fn stamp_text(stamp_ns: i64) -> String {
    let sign = if stamp_ns < 0 { "-" } else { "" };
    let ns = stamp_ns.unsigned_abs();
    format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Result<Trajectory, Error> {
        Trajectory::read_from(text, "t.txt")
    }

    #[test]
    fn stamps_are_read_to_the_nanosecond() {
        assert_eq!(
            parse_stamp_ns("1700000000.200000048"),
            Some(1_700_000_000_200_000_048)
        );
        assert_eq!(parse_stamp_ns("12"), Some(12_000_000_000));
        assert_eq!(parse_stamp_ns("-0.5"), Some(-500_000_000));
        assert_eq!(parse_stamp_ns("1.0000000019"), Some(1_000_000_001));
        assert_eq!(parse_stamp_ns("1.5e9"), Some(1_500_000_000_000_000_000));
        for wrong in [
            "",
            ".5",
            "1.2.3",
            "nan",
            "inf",
            "1e400",
            "99999999999999",
            "1,5",
            "--1",
        ] {
            assert_eq!(parse_stamp_ns(wrong), None, "{wrong}");
        }
        assert_eq!(stamp_text(-500_000_000), "-0.500000000");
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut trajectory = Trajectory::stamped();
        trajectory.push(1_700_000_000_200_000_048, 1, Pose2::new(1.5, -2.25, 3.1));
        trajectory.push(1_700_000_000_400_000_000, 2, Pose2::new(0.0, 0.0, -1.5));
        let text = trajectory.to_tum();
        assert_eq!(text.lines().next(), Some("# odom_frame_id 1"));
        let again = read(text.as_bytes()).unwrap();
        let frames = again.poses().chunk_by(|a, b| a.frame == b.frame);
        assert_eq!(frames.count(), 2);
        for (a, b) in again.poses().iter().zip(trajectory.poses()) {
            assert_eq!((a.stamp_ns, a.frame), (b.stamp_ns, b.frame));
            let error = a.transform.between(&b.transform);
            assert!(error.distance_m() < 1e-6 && error.angle_rad() < 1e-7);
        }
    }

    #[test]
    fn a_bad_row_is_named_by_its_line() {
        for (text, words) in [
            (
                &b"# c\n\n1 2 3\n"[..],
                "t.txt:3: 3 columns; a TUM row has 8",
            ),
            (
                b"1 0 0 0 0 0 0 1\n2 0 nan 0 0 0 0 1\n",
                "t.txt:2: \"nan\" must be a finite number",
            ),
            (b"1 0 1e300 0 0 0 0 1\n", "t.txt:1: \"1e300\" must be"),
            (
                b"1 0 0 0 0 0 0 0\n",
                "t.txt:1: quaternion 0 0 0 0 has length 0, it must be 1",
            ),
            (
                b"2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n",
                "t.txt:2: stamp 1.000000000 is not after",
            ),
            (
                b"1 0 0 0 0 0 0 1\n1 0 0 0 0 1 0 0 0 0 1 0\n",
                "t.txt:2: TUM rows (8 numbers) and",
            ),
            (
                b"1 0 0 0 0 0 1 0 0 -1 0 0\n",
                "t.txt:1: [1 0; 0 0] is no rotation in the plane",
            ),
            (b"\xff\xfe\x00", "t.txt:1: not text"),
            (
                b"# odom_frame_id two\n",
                "t.txt:1: odom_frame_id \"two\" must be a whole number",
            ),
            (b"", "t.txt: no poses"),
            (b"# nothing\n\n", "t.txt: no poses"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        }
        let endless = std::io::Cursor::new(vec![0; 1 << 17]);
        assert!(Trajectory::read_from(endless, "zero").is_err());
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes: Vec<u8>) {
            let _ = read(&bytes);
        }

        #[test]
        fn any_cells_are_read_or_refused(text in "([0-9.eE+-]{1,8}[ \n]){0,60}") {
            let _ = read(text.as_bytes());
        }

        #[test]
        fn every_stamp_survives(stamp_ns: i64) {
            proptest::prop_assert_eq!(parse_stamp_ns(&stamp_text(stamp_ns)), Some(stamp_ns));
        }
    }
}
