//! Which configuration Python asks for.

use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, PyResult};
use randt_config::{Config, Loaded, Selection};
use std::fmt::Display;

/// The configuration of a profile, a radar and single keys, as the programs load it.
pub fn load(
    profile: Option<String>,
    sensor: Option<String>,
    sensor_from_input: Option<&'static str>,
    robot: Option<String>,
    set: Vec<String>,
) -> PyResult<Loaded> {
    let selection = Selection {
        profile,
        sensor,
        sensor_from_input,
        robot,
        set,
        recorded: None,
    };
    Config::load(&selection).map_err(value_error)
}

/// An error that names the value.
pub fn value_error(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
