//! Whole-program tests: real binaries in temporary directories. One program, so that it is linked
//! once and tests that wait run side by side; `cargo test --test programs NAME::` runs the tests
//! of one file.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

mod support;

mod ablation;
mod accuracy;
mod bad_data;
mod bad_input;
mod bounds;
mod built_in_worlds;
mod bus;
mod calibrate;
mod config;
mod death;
mod dependencies;
mod doctor;
mod documents;
mod drive_end;
mod drives;
mod eval;
mod faults;
mod former_builds;
#[cfg(target_os = "linux")]
mod full;
mod graph;
mod held_clean_up;
mod import;
mod imu;
mod inspect;
mod kill_storm;
mod link;
mod links;
mod live;
mod log;
mod log_holes;
mod lying;
mod machines;
mod map;
mod mission;
mod numbers;
mod operate;
mod owner;
mod package;
mod pipeline;
mod plot;
mod ports;
mod power_cut;
mod recorder;
mod replay;
mod resources;
mod ros1;
mod ros2;
mod ros2_cost;
mod same_bits;
mod same_bits_live;
mod sensors;
mod shared_memory;
mod shown_commands;
mod simulate;
mod soak;
mod strangers;
mod systemd;
mod top;
mod trust;
mod trust_bench;
mod tutorials;
mod view;
mod view_access;
mod wrong_packets;
