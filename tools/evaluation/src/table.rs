//! True poses as data sets publish them, in tables with commas: Oxford's radar odometry (relative
//! motions), Boreas' poses of a sensor (positions and angles) and MulRan's global poses (a stamp
//! and a 3 x 4 matrix).

use crate::read::{POSITION_MAX_M, flattened, parse_kitti, stamp_text};
use crate::trajectory::TrajectoryPose;
use crate::{Error, Trajectory};
use randt_geometry::{
    Pose2,
    elementary::{atan2, sin_cos},
};

/// Columns of Oxford's table, as its header names them.
const OXFORD: [&str; 5] = ["source_timestamp", "destination_timestamp", "x", "y", "yaw"];

/// Columns of Boreas' table, as its header names them.
const BOREAS: [&str; 7] = [
    "gpstime", "easting", "northing", "altitude", "roll", "pitch", "heading",
];

/// A row of a table.
struct Row<'a> {
    cells: Vec<&'a str>,
    path: &'a str,
    line: usize,
}

impl<'a> Row<'a> {
    fn new((line, text): (usize, &'a str), path: &'a str) -> Self {
        let cells = text.split(',').map(str::trim).collect();
        Self { cells, path, line }
    }

    fn cell(&self, at: usize) -> &'a str {
        self.cells.get(at).copied().unwrap_or_default()
    }

    fn refuse(&self, problem: String) -> Error {
        Error::Row {
            path: self.path.to_owned(),
            line: self.line,
            problem,
        }
    }

    fn refuse_cell(&self, at: usize, wanted: &str) -> Error {
        let problem = format!("column {}: {:?} must be {wanted}", at + 1, self.cell(at));
        self.refuse(problem)
    }

    fn number(&self, at: usize) -> Result<f64, Error> {
        let value: Option<f64> = self.cell(at).parse().ok();
        let value = value.filter(|value| value.abs() <= POSITION_MAX_M);
        value.ok_or_else(|| self.refuse_cell(at, &format!("a number up to {POSITION_MAX_M:e}")))
    }

    /// A stamp in whole us, as ns.
    fn stamp_ns(&self, at: usize) -> Result<i64, Error> {
        let us: Option<i64> = self.cell(at).parse().ok();
        us.and_then(|us| us.checked_mul(1000))
            .ok_or_else(|| self.refuse_cell(at, "us"))
    }
}

/// Reads a table; `path` is for messages.
pub(crate) fn read(text: &str, path: &str) -> Result<Trajectory, Error> {
    let lines = (1..).zip(text.lines());
    let mut rows = lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|line| Row::new(line, path))
        .peekable();
    let empty = || Error::Empty {
        path: path.to_owned(),
    };
    let header = rows.peek().ok_or_else(empty)?;
    let names: Vec<String> = header
        .cells
        .iter()
        .map(|name| name.to_lowercase())
        .collect();
    let column = |wanted: &str| names.iter().position(|name| name == wanted);
    let mut trajectory = match (OXFORD.map(column), BOREAS.map(column)) {
        ([Some(a), Some(b), Some(x), Some(y), Some(yaw)], _) => {
            read_motions(rows.skip(1), [a, b, x, y, yaw])?
        }
        (
            _,
            [
                Some(a),
                Some(x),
                Some(y),
                Some(z),
                Some(roll),
                Some(pitch),
                Some(yaw),
            ],
        ) => read_boreas(rows.skip(1), [a, x, y, z, roll, pitch, yaw])?,
        _ => read_matrices(rows)?,
    };
    trajectory.sort();
    let mut pairs = trajectory.poses().windows(2);
    if let Some([_, b]) =
        pairs.find(|p| matches!(p, [a, b] if a.stamp_ns == b.stamp_ns && a.frame == b.frame))
    {
        return Err(Error::Row {
            path: path.to_owned(),
            line: 1,
            problem: format!("stamp {} is there twice", stamp_text(b.stamp_ns)),
        });
    }
    match trajectory.poses() {
        [] => Err(empty()),
        _ => Ok(trajectory),
    }
}

/// Oxford's motions from one sweep to the next.
fn read_motions<'a>(
    rows: impl Iterator<Item = Row<'a>>,
    [source, destination, x, y, yaw]: [usize; 5],
) -> Result<Trajectory, Error> {
    let mut trajectory = Trajectory::stamped();
    let mut pose = Pose2::default();
    let (mut last_ns, mut frame) = (None, 0);
    for row in rows {
        // It takes points of the newer sweep, the source, into the older one; y points right.
        let (newer_ns, older_ns) = (row.stamp_ns(source)?, row.stamp_ns(destination)?);
        let motion = Pose2::new(row.number(x)?, -row.number(y)?, -row.number(yaw)?);
        if last_ns != Some(older_ns) {
            frame += u64::from(last_ns.is_some());
            trajectory.push(older_ns, frame, pose);
        }
        pose = pose.compose(&motion);
        trajectory.push(newer_ns, frame, pose);
        last_ns = Some(newer_ns);
    }
    Ok(trajectory)
}

/// Boreas' poses of a sensor: east, north and up, and angles of which the data set's kit makes the
/// rotation from the sensor as roll pitch yaw, each of them clockwise. Its radar's z points down,
/// so that its x is at the heading, counter-clockwise from east.
fn read_boreas<'a>(
    rows: impl Iterator<Item = Row<'a>>,
    [stamp, east, north, up, roll, pitch, heading]: [usize; 7],
) -> Result<Trajectory, Error> {
    let mut trajectory = Trajectory::stamped();
    for row in rows {
        let (sin_roll, cos_roll) = sin_cos(row.number(roll)?);
        let (sin_pitch, cos_pitch) = sin_cos(row.number(pitch)?);
        let (sin_yaw, cos_yaw) = sin_cos(row.number(heading)?);
        // Where the sensor's x points: the first column of that rotation.
        let (x_east, x_north) = (
            cos_pitch * cos_yaw,
            sin_roll * sin_pitch * cos_yaw - cos_roll * sin_yaw,
        );
        let pose = Pose2::new(
            row.number(east)?,
            row.number(north)?,
            atan2(x_north, x_east),
        );
        trajectory.push(row.stamp_ns(stamp)?, 0, pose);
        // Upside down is no tilt.
        trajectory.leave_out([row.number(up)?, (cos_roll * cos_pitch).abs()]);
    }
    Ok(trajectory)
}

/// MulRan's poses: a stamp and a matrix.
fn read_matrices<'a>(rows: impl Iterator<Item = Row<'a>>) -> Result<Trajectory, Error> {
    let mut trajectory = Trajectory::stamped();
    for row in rows {
        let stamp_ns = row.cell(0).parse::<i64>().ok();
        let numbers = row.cells.iter().skip(1).filter_map(|c| c.parse().ok());
        let numbers: Vec<f64> = numbers
            .filter(|n: &f64| n.abs() <= POSITION_MAX_M)
            .collect();
        let (Some(stamp_ns), [matrix]) = (stamp_ns, numbers.as_chunks::<12>().0) else {
            let columns = row.cells.len();
            return Err(row.refuse(format!(
                "{columns} columns; a table of true poses is Oxford's (source_timestamp, destination_timestamp, x, y, ..., yaw), Boreas' (GPSTime, easting, northing, altitude, ..., roll, pitch, heading), or has a stamp in ns and a 3 x 4 matrix"
            )));
        };
        let transform = parse_kitti(matrix).map_err(|why| row.refuse(why))?;
        trajectory.push_pose(TrajectoryPose {
            stamp_ns,
            frame: 0,
            transform,
        });
        trajectory.leave_out(flattened(matrix));
    }
    Ok(trajectory)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn relative_motions_become_a_path_with_y_to_the_left() {
        let text = "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw\n\
                    250000,0,2.0,0.0,0,0,0,1.5707963\n500000,250000,1.0,0,0,0,0,0\n\
                    1000000,750000,1.0,0,0,0,0,0\n";
        let path = read(text, "t.csv").unwrap();
        assert_eq!(path.poses().len(), 5);
        let [x_m, y_m] = path.poses()[2].position_m();
        assert!(
            (x_m - 2.0).abs() < 1e-6 && (y_m + 1.0).abs() < 1e-6,
            "{x_m} {y_m}"
        );
        assert_eq!((path.poses()[2].frame, path.poses()[3].frame), (0, 1));
    }

    #[test]
    fn global_poses_have_their_stamps_and_say_what_is_left_out() {
        let text = "1000,1,0,0,5,0,1,0,6,0,0,1,7\n2000,1,0,0,6,0,1,0,6,0,0,1,9\n";
        let path = read(text, "t.csv").unwrap();
        assert_eq!(path.poses()[1].position_m(), [6.0, 6.0]);
        assert_eq!(path.left_out().height_m(), 2.0);
        assert!(read("1,2,3\n", "t.csv").is_err() && read("\n", "t.csv").is_err());
    }

    #[test]
    fn boreas_radar_hangs_with_z_down_and_x_at_its_heading() {
        let header = "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n";
        // Driving east, then north; the same with z up, where the kit's angles are clockwise.
        for (roll, sign) in [(PI, 1.0), (0.0, -1.0)] {
            let row = |us: i64, east: f64, north: f64, heading: f64| {
                let heading = sign * heading;
                format!("{us},{east},{north},154.0,0,0,0,{roll},0.02,{heading},0,0,0\n")
            };
            let text = header.to_owned()
                + &row(1_630_597_331_060_160, 623_422.85, 4_848_820.5, 0.0)
                + &row(1_630_597_331_310_779, 623_424.85, 4_848_821.5, 1.25);
            let path = read(&text, "t.csv").unwrap();
            let [a, b] = path.poses() else {
                panic!("two rows");
            };
            assert_eq!(a.stamp_ns, 1_630_597_331_060_160_000);
            let expected = Pose2::new(2.0, 1.0, 1.25).into();
            let apart = a.transform.between(&b.transform).between(&expected);
            assert!(apart.distance_m() < 1e-6 && apart.angle_rad().abs() < 1e-3);
            assert!((path.left_out().tilt_deg() - 1.146).abs() < 0.01);
        }
        let error = read(&(header.to_owned() + "1,2,3\n"), "t.csv").unwrap_err();
        assert!(error.to_string().contains("t.csv:2: column 8"), "{error}");
    }
}
