//! The program `randt` inside Python's process.

use crate::configuration::value_error;
use clap::{CommandFactory, FromArgMatches};
use pyo3::{PyResult, Python, pyfunction};
use randt::commands::{Arguments, layout};
use randt::exit::status;
use randt_evaluation::Trajectory;

/// Runs a command line; gives the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<String>) -> u8 {
    let line = std::iter::once("randt".to_owned()).chain(arguments);
    let command = Arguments::command().version(randt_version::VERSION);
    let matches = command.try_get_matches_from(line);
    match matches.and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => py.detach(|| status(arguments.command.run())),
        Err(error) => {
            // Help goes to standard output, what is wrong to standard error.
            let _ = error.print();
            error.exit_code() as u8
        }
    }
}

/// A figure's name with its unit, and its value where it is defined.
type Figure = (&'static str, Option<f64>);

/// The figures of a trajectory against the truth, both as TUM files.
#[pyfunction]
pub fn evaluate(estimate: &str, truth: &str) -> PyResult<Vec<Figure>> {
    let estimate = Trajectory::read(estimate).map_err(value_error)?;
    let truth = Trajectory::read(truth).map_err(value_error)?;
    let figures = randt_evaluation::evaluate(&estimate, &truth).map_err(value_error)?;
    Ok(vec![
        ("ate_rmse_m", figures.ate_rmse_m),
        ("rpe_translation_mean_m", figures.rpe_translation_mean_m),
        ("rpe_rotation_mean_deg", figures.rpe_rotation_mean_deg),
        (
            "kitti_translation_percent",
            figures.kitti_translation_percent,
        ),
        (
            "kitti_rotation_deg_per_100m",
            figures.kitti_rotation_deg_per_100m,
        ),
        ("coverage", Some(figures.coverage)),
        ("path_m", Some(figures.path_m)),
    ])
}

/// The Python module that `randt layout --python` prints.
#[pyfunction]
pub fn bus_module() -> PyResult<String> {
    layout::python_module().map_err(value_error)
}
