//! Names that a live view, a recording and an export share, so that one layout shows all of them.

/// The live pose.
pub const POSE: &str = "view/pose";
/// How the frames lie in each other.
pub const TRANSFORMS: &str = "view/transforms";
/// The filtered returns.
pub const POINTS: &str = "view/points";
/// The occupancy grid.
pub const GRID: &str = "view/grid";
