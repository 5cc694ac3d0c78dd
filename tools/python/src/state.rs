//! What odometry publishes, for Python.

use pyo3::types::PyBytes;
use pyo3::{Bound, Python, pyclass, pymethods};
use randt_messages::{Keyframe as KeyframeTopic, Message, OdometryState};

/// The estimate at the end of a sweep.
#[pyclass(frozen, module = "randt._randt")]
pub struct State(pub OdometryState);

#[pymethods]
impl State {
    #[getter]
    fn stamp_ns(&self) -> i64 {
        self.0.header.stamp_ns
    }

    #[getter]
    fn odom_frame_id(&self) -> u64 {
        self.0.odom_frame_id
    }

    #[getter]
    fn pose(&self) -> [f64; 3] {
        self.0.pose
    }

    #[getter]
    fn velocity(&self) -> [f64; 3] {
        self.0.velocity
    }

    #[getter]
    fn covariance(&self) -> [f64; 9] {
        self.0.covariance
    }

    #[getter]
    fn trust(&self) -> &'static str {
        self.0.trust().as_str()
    }

    #[getter]
    fn localizability(&self) -> &'static str {
        self.0.localizability().as_str()
    }

    #[getter]
    fn weak_direction_rad(&self) -> Option<f64> {
        self.0.weak_direction()
    }

    #[getter]
    fn gyro_bias_rad_s(&self) -> [f64; 3] {
        self.0.gyro_bias_rad_s
    }

    #[getter]
    fn fit(&self) -> f64 {
        self.0.fit
    }

    #[getter]
    fn cells(&self) -> u32 {
        self.0.cells
    }

    #[getter]
    fn inliers(&self) -> u32 {
        self.0.inliers
    }
}

/// A scan with its final pose, de-skewed.
#[pyclass(frozen, module = "randt._randt")]
pub struct Keyframe(pub Message<KeyframeTopic>);

#[pymethods]
impl Keyframe {
    #[getter]
    fn stamp_ns(&self) -> i64 {
        self.0.head.header.stamp_ns
    }

    #[getter]
    fn odom_frame_id(&self) -> u64 {
        self.0.head.odom_frame_id
    }

    #[getter]
    fn pose(&self) -> [f64; 3] {
        self.0.head.pose
    }

    /// x m, y m, intensity of every point, f32.
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let points = self.0.items.iter();
        let rows: Vec<[f32; 3]> = points
            .map(|point| [point.x_m, point.y_m, point.intensity])
            .collect();
        PyBytes::new(py, bytemuck::cast_slice(&rows))
    }
}
