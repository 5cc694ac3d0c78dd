//! Normal distributions transform with intensity as third dimension (RaNDT, III-B and III-C).
//!
//! Responsible for cells, grids of cells, and what one scan's cells contribute to a pose: the
//! robust distribution-to-distribution distance with its derivatives. Not responsible for solving,
//! for motion or for when a scan enters a map. No I/O, no clock.
//!
//! ```
//! use randt_geometry::Pose2;
//! use randt_ndt::{Association, AdaptiveLoss, CellRule, Grid, ScanCell, evaluate};
//!
//! // A wall along x and one along y, seen by a map and by a scan from 5 cm further left.
//! let rule = CellRule { points_min: 4, use_intensity: true, cell_size_m: 0.5, slack: 0.0 };
//! let mut map = Grid::new(8.0, rule);
//! let mut scan = Grid::new(8.0, rule);
//! for i in 0..200 {
//!     let s = f64::from(i) * 0.02;
//!     let rough = f64::from(i % 5) * 0.01;
//!     for p in [[s, 2.0 + rough, 9.0 + rough], [4.0 + rough, s, 20.0 - rough]] {
//!         map.add(p);
//!         scan.add([p[0], p[1] - 0.05, p[2]]);
//!     }
//! }
//! map.refresh();
//! scan.refresh();
//! let cells: Vec<ScanCell> = scan.cells().map(|cell| ScanCell::new(cell, 0.0)).collect();
//! let mut associations = Vec::new();
//! let loss = AdaptiveLoss::new(-1.5, 2.0, 1.0);
//! let mut pose = Pose2::IDENTITY;
//! for _ in 0..8 {
//!     Association::find(&map, &cells, &pose, 4, &mut associations);
//!     let normal = evaluate(&cells, &associations, &pose, [0.0; 3], &loss);
//!     let step = normal.pose.lu().solve(&(-normal.pose_gradient)).unwrap();
//!     pose = pose.compose(&Pose2::exp(step));
//! }
//! assert!((pose.y_m - 0.05).abs() < 5e-3);
//! ```

mod association;
mod cell;
mod distribution;
mod grid;
mod loss;
mod residual;
pub mod scalar;

pub use association::Association;
pub use cell::{Cell, CellRule, ScanCell};
pub use distribution::Distribution;
pub use grid::Grid;
pub use loss::AdaptiveLoss;
pub use residual::{NormalEquations, evaluate};
