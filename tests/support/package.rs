//! The programs that are packaged.

use super::stages;
use std::path::{Path, PathBuf};

/// Their names, a line each.
pub const PROGRAMS: &str = include_str!("../../systemd/package/programs");

/// Where one of them was built.
pub fn program(name: &str) -> PathBuf {
    match name.strip_prefix("randt-") {
        Some(stage) => stages::program(stage),
        None => Path::new(env!("CARGO_BIN_EXE_randt")).to_owned(),
    }
}
