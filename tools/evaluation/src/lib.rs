//! Trajectory errors (ATE, RPE, KITTI drift, lost track, silent metres), loops and covariances
//! against the truth, and plots.
//!
//! Responsible for trajectory files, for what belongs together in two of them, for the figures as
//! they are published elsewhere, and for the pictures: a drive from above, and figures over time.
//! Not responsible for how they are used.
//!
//! ```
//! use randt_evaluation::{Trajectory, evaluate};
//!
//! let truth = "0.0 0 0 0 0 0 0 1\n1.0 1 0 0 0 0 0 1\n2.0 2 0 0 0 0 0 1\n";
//! let estimate = "0.0 5 5 0 0 0 0 1\n1.0 5 6 0 0 0 0 1\n2.0 5 7 0 0 0 0 1\n";
//! let truth = Trajectory::read_from(truth.as_bytes(), "truth.tum")?;
//! let estimate = Trajectory::read_from(estimate.as_bytes(), "estimate.tum")?;
//! let evaluation = evaluate(&estimate, &truth)?;
//! assert!(evaluation.ate_rmse_m.is_some_and(|error_m| error_m < 1e-12));
//! assert_eq!(evaluation.kitti_translation_percent, None);
//! # Ok::<(), randt_evaluation::Error>(())
//! ```

mod absolute;
mod axis;
mod chart;
mod colours;
mod consistency;
mod error;
mod evaluation;
mod loops;
mod pairs;
mod panel;
mod plot;
mod read;
mod relative;
mod silently_wrong;
mod support;
mod table;
mod thin;
mod ticks;
mod timeline;
mod track;
mod trajectory;
mod transform;
mod trust_response;
mod view;
mod write;

pub use chart::{Chart, plot_chart};
pub use colours::Colour;
pub use consistency::{
    Motion, MotionError, MotionErrors, NormalizedError, ScanEstimate, normalized_errors,
};
pub use error::Error;
pub use evaluation::{Evaluation, evaluate, truth_on_estimate};
pub use loops::{FalseLoop, LoopEdge, LoopEvaluation, LoopLimits, evaluate_loops};
pub use panel::{Band, Line, Panel};
pub use plot::{Plot, plot_trajectories};
pub use read::stamp_text;
pub use silently_wrong::{SilentlyWrong, TrustSpan, silently_wrong};
pub use support::DirectionalSupport;
pub use track::{Track, Worst, track};
pub use trajectory::{LeftOut, Trajectory, TrajectoryPose};
pub use transform::Transform;
pub use trust_response::{ScanTrust, changes_per_minute, seconds_until};
