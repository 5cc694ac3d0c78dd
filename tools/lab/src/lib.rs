//! `randt-lab` as a library: the commands that research needs, on the pipeline of `randt`.
//!
//! Responsible for evaluation, ablation, benchmarks of trust and of the solver, and examination of
//! sensors. Not
//! responsible for what operators and users of recordings need: those commands are `randt`'s.

mod commands;
pub mod faults;

pub use commands::{Command, EXAMPLES, GROUPS};
