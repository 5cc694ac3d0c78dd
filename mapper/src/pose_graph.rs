//! The 2-D pose graph: where every keyframe is, given odometry and loops.
//!
//! Responsible for the least-squares estimate, for switching off loops that contradict the rest,
//! for how well one node is known from another, and for the constraints that the mapper's
//! keyframes bring. Not responsible for finding loops.
//!
//! ```
//! use nalgebra::Matrix3;
//! use randt_geometry::Pose2;
//! use randt_mapper::KeyframeIdx;
//! use randt_mapper::pose_graph::{Edge, PoseGraph};
//!
//! let edge = |from, to, x_m, yaw_rad| Edge {
//!     from: KeyframeIdx(from),
//!     to: KeyframeIdx(to),
//!     measured: Pose2::new(x_m, 0.0, yaw_rad),
//!     information: Matrix3::identity() * 400.0,
//! };
//! let quarter = core::f64::consts::FRAC_PI_2;
//! let mut graph = PoseGraph::default();
//! graph.add_node(Pose2::IDENTITY)?;
//! for node in 0..4 {
//!     graph.append(edge(node, node + 1, 1.0, quarter))?;
//! }
//! let id = graph.add_loop(edge(0, 4, 0.1, 0.0))?;
//! let report = graph.optimise()?;
//! assert!(report.converged && report.chi2 < 4.0);
//! assert_eq!(graph.loops()[0].id, id);
//! // The square closes within the loop's error, shared with the four edges.
//! assert!((graph.poses()[4].x_m - 0.08).abs() < 0.01);
//! # Ok::<(), randt_mapper::pose_graph::Error>(())
//! ```

mod chordal;
mod components;
mod consensus;
mod covariance;
mod dense;
mod edge;
mod error;
mod graph;
mod keyframe_graph;
mod loss;
mod odometry;
mod prior;
mod saved;
mod solver;
mod system;
mod tail;
#[cfg(test)]
mod testing;
mod visitors;

pub use consensus::Recheck;
pub use edge::Edge;
pub use error::Error;
pub use graph::{Attachment, Loop, LoopId, Marginals, PoseGraph};
pub(crate) use keyframe_graph::KeyframeGraph;
pub(crate) use prior::{Prior, deviation, position_sigma_m};
pub(crate) use saved::SavedGraph;
pub use solver::{Report, Start};
pub(crate) use visitors::Visitors;
