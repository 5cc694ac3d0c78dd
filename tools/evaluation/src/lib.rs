//! Trajectory errors (ATE, RPE, KITTI drift) and plots.
