//! True poses as data sets publish them, in tables with commas: Oxford's radar odometry (relative
//! motions) and MulRan's global poses (a stamp and a 3 x 4 matrix).

use crate::read::{flattened, parse_kitti, stamp_text};
use crate::trajectory::TrajectoryPose;
use crate::{Error, Trajectory};
use randt_geometry::Pose2;

/// Columns of Oxford's table, as its header names them.
const OXFORD: [&str; 5] = ["source_timestamp", "destination_timestamp", "x", "y", "yaw"];

/// Reads a table; `path` is for messages.
pub(crate) fn read(text: &str, path: &str) -> Result<Trajectory, Error> {
    let mut lines = (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty());
    let empty = || Error::Empty {
        path: path.to_owned(),
    };
    let refuse = |line: usize, problem: String| Error::Row {
        path: path.to_owned(),
        line,
        problem,
    };
    let header = lines.clone().next().ok_or_else(empty)?.1.to_lowercase();
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let columns = OXFORD.map(|wanted| names.iter().position(|name| *name == wanted));
    let mut trajectory = Trajectory::stamped();
    if let [Some(source), Some(destination), Some(x), Some(y), Some(yaw)] = columns {
        lines.next();
        let mut pose = Pose2::default();
        let (mut last_ns, mut frame) = (None, 0);
        for (number, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let cell = |at: usize| cells.get(at).copied().unwrap_or_default();
            let value = |at: usize| {
                let value: Option<f64> = cell(at).parse().ok();
                value.filter(|value| value.is_finite()).ok_or_else(|| {
                    refuse(
                        number,
                        format!("column {}: {:?} must be a number", at + 1, cell(at)),
                    )
                })
            };
            let stamp = |at: usize| {
                let us: Option<i64> = cell(at).parse().ok();
                us.and_then(|us| us.checked_mul(1000)).ok_or_else(|| {
                    refuse(
                        number,
                        format!("column {}: {:?} must be us", at + 1, cell(at)),
                    )
                })
            };
            // It takes points of the newer sweep, the source, into the older one; y points right.
            let (newer_ns, older_ns) = (stamp(source)?, stamp(destination)?);
            let motion = Pose2::new(value(x)?, -value(y)?, -value(yaw)?);
            if last_ns != Some(older_ns) {
                frame += u64::from(last_ns.is_some());
                trajectory.push(older_ns, frame, pose);
            }
            pose = pose.compose(&motion);
            trajectory.push(newer_ns, frame, pose);
            last_ns = Some(newer_ns);
        }
    } else {
        for (number, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let stamp_ns = cells.first().and_then(|cell| cell.parse::<i64>().ok());
            let numbers: Vec<f64> = cells
                .iter()
                .skip(1)
                .filter_map(|c| c.parse().ok())
                .collect();
            let (Some(stamp_ns), [matrix]) = (stamp_ns, numbers.as_chunks::<12>().0) else {
                let problem = format!(
                    "{} columns; a table of true poses is Oxford's (source_timestamp, destination_timestamp, x, y, ..., yaw) or has a stamp in ns and a 3 x 4 matrix",
                    cells.len()
                );
                return Err(refuse(number, problem));
            };
            let transform = parse_kitti(matrix).map_err(|why| refuse(number, why))?;
            trajectory.push_pose(TrajectoryPose {
                stamp_ns,
                frame: 0,
                transform,
            });
            trajectory.leave_out(flattened(matrix));
        }
    }
    trajectory.sort();
    let mut pairs = trajectory.poses().windows(2);
    if let Some([_, b]) =
        pairs.find(|p| matches!(p, [a, b] if a.stamp_ns == b.stamp_ns && a.frame == b.frame))
    {
        return Err(refuse(
            1,
            format!("stamp {} is there twice", stamp_text(b.stamp_ns)),
        ));
    }
    match trajectory.poses() {
        [] => Err(empty()),
        _ => Ok(trajectory),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
