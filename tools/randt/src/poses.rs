//! Poses from wherever they are: a trajectory's file, the true ones in a log, a run's folder.

use anyhow::{Context, ensure};
use randt_evaluation::Trajectory;
use randt_geometry::Pose2;
use randt_readers::{Event, Options};
use std::io::Read;
use std::path::Path;

/// Reads poses. Those of a folder that `randt run` wrote are of its `trajectory.tum`.
pub fn read(path: &str) -> anyhow::Result<Trajectory> {
    let folder = Path::new(path);
    if folder.is_dir() {
        let file = folder.join("trajectory.tum");
        return Ok(Trajectory::read(&file.to_string_lossy())?);
    }
    if !is_log(folder)? {
        return Ok(Trajectory::read(path)?);
    }
    let options = Options {
        radar_required: false,
        ..Options::default()
    };
    let mut source = randt_readers::open(folder, &options)?;
    let mut truth = Trajectory::stamped();
    while let Some(event) = source.next_event()? {
        if let Event::Truth(pose) = event {
            truth.push(pose.header.stamp_ns, 0, Pose2::from_array(pose.pose));
        }
    }
    ensure!(
        !truth.poses().is_empty(),
        "{path}: the log has no true poses (truth/pose)"
    );
    Ok(truth)
}

/// Whether a file is an MCAP.
fn is_log(path: &Path) -> anyhow::Result<bool> {
    let mut first = [0; 5];
    let context = || path.display().to_string();
    let mut file = std::fs::File::open(path).with_context(context)?;
    // A shorter file is none.
    Ok(file.read_exact(&mut first).is_ok() && first == *b"\x89MCAP")
}
