//! The extension module `randt._randt`, below the Python files in `randt/`.
//!
//! Responsible for handing Python what the Rust crates compute, as plain numbers and bytes in
//! numpy's own order. Not responsible for arrays, names and documentation: the Python files are.
#![allow(
    missing_docs,
    reason = "`randt/*.py` and `_randt.pyi` document what Python sees"
)]

mod configuration;
mod estimator;
mod program;
mod recording;
mod scan;
mod state;

use pyo3::pymodule;

/// The module.
#[pymodule]
mod _randt {
    #[pymodule_export]
    use super::estimator::{Estimator, register};
    #[pymodule_export]
    use super::program::{bus_module, evaluate, main};
    #[pymodule_export]
    use super::recording::Recording;
    #[pymodule_export]
    use super::scan::Scan;
    #[pymodule_export]
    use super::state::{Keyframe, State};
}
