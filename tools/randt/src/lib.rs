//! The command line of randt, as a library: the offline composition of the stages, and the
//! commands.
//!
//! Responsible for commands, options, progress, files and reports. Not responsible for any
//! algorithm.

pub mod commands;
pub mod compare;
pub mod components;
pub mod date;
pub mod digest;
pub mod drive;
pub mod earlier;
pub mod exit;
pub mod extents;
pub mod final_poses;
pub mod finish_drive;
pub mod found_loops;
pub mod help;
pub mod identity;
pub mod input;
pub mod job;
pub mod journal_input;
pub mod judgement;
pub mod latency;
pub mod loops;
pub mod machine;
pub mod map_png;
pub mod mission;
pub mod missions;
pub mod odometry_csv;
pub mod output;
pub mod pipeline;
pub mod plain_file;
pub mod poses;
pub mod process;
pub mod progress;
pub mod recorded;
pub mod recovered_drive;
pub mod report;
pub mod results;
pub mod ros_topics;
pub mod trust_spans;
pub mod units;
