//! A small world that is unlike its mirror image and its own turns: an L with niches, driven round
//! twice in 90 s.

use super::{ended, randt};
use std::fs;
use std::path::{Path, PathBuf};

/// Arms of 14 m and 11 m, one 5 m wide and one 6 m; unequal niches, furniture inside the route's
/// ring.
pub const WORLD: &str = "
wall concrete 0,0 9,0 9,-0.8 10.5,-0.8 10.5,0 14,0 14,5 6,5 6,11 2.5,11 2.5,11.6 1,11.6 1,11 0,11
wall concrete 0,11 0,8 -1.2,8 -1.2,7 0,7 0,0
block metal 2.6,5 0.9x1.6
block wood 7,2.2 1.8x0.7
post concrete 3.6,2.4 0.2
block metal 13.2,0 0.8x0.5
block wood 5.2,10 0.8x1
route 1.5,1.5 6,1.2 12.3,1.3 12.5,3.6 8,3.8 4.9,3.9 4.5,6 4.4,9.4 1.6,9.3 1.4,5
";

/// The log and the truth of a drive of two laps.
pub fn drive(folder: &Path) -> (PathBuf, PathBuf) {
    let at = |name: &str| folder.join(name);
    fs::write(at("hall.world"), WORLD).unwrap();
    let mut command = randt(&["simulate", "--world"]);
    command.arg(at("hall.world"));
    command.arg("--out").arg(at("hall.mcap"));
    command.arg("--truth").arg(at("hall.tum"));
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    (at("hall.mcap"), at("hall.tum"))
}
