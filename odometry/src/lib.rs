//! radar/points and imu/sample to odometry/state and odometry/keyframe.
