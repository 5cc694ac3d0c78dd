//! A recording, event by event.

use crate::configuration::value_error;
use crate::scan::Scan;
use pyo3::{Bound, IntoPyObjectExt, PyAny, PyResult, Python, pyclass, pymethods};
use randt_messages::Event;
use randt_readers::{Options, Source};
use std::path::PathBuf;

/// Any input that `randt run` reads.
#[pyclass(unsendable, module = "randt._randt")]
pub struct Recording {
    source: Box<dyn Source>,
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (path, radar_topic=None, imu_topic=None, twist_topic=None))]
    fn new(
        path: PathBuf,
        radar_topic: Option<String>,
        imu_topic: Option<String>,
        twist_topic: Option<String>,
    ) -> PyResult<Self> {
        let options = Options {
            radar_topic,
            imu_topic,
            twist_topic,
            ..Options::default()
        };
        let source = randt_readers::open(&path, &options).map_err(value_error)?;
        Ok(Self { source })
    }

    #[getter]
    fn format(&self) -> &'static str {
        self.source.info().format
    }

    #[getter]
    fn sensor(&self) -> Option<&'static str> {
        self.source.info().sensor.name()
    }

    /// x m, y m, yaw rad of the radar in `base_link`.
    #[getter]
    fn radar_mounting(&self) -> Option<[f64; 3]> {
        let radar = self.source.info().extrinsics.radar;
        radar.map(|pose| pose.to_array())
    }

    /// Roll, pitch, yaw of the IMU in `base_link`, rad.
    #[getter]
    fn imu_mounting_rad(&self) -> Option<[f64; 3]> {
        let imu = self.source.info().extrinsics.imu;
        imu.map(|orientation| orientation.roll_pitch_yaw().into())
    }

    /// Name, count, first case and whether it is a loss, of all that was dropped or repaired.
    fn counters(&self) -> Vec<(&'static str, u64, String, bool)> {
        let counters = self.source.counters().into_iter();
        counters
            .map(|counter| (counter.name, counter.count, counter.first, counter.loss))
            .collect()
    }

    /// The next event as its kind and its values; `None` at the end.
    fn next_event<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let event = self.source.next_event().map_err(value_error)?;
        let event = event.map(|event| match event {
            Event::Scan(scan) => ("scan", Scan(scan)).into_bound_py_any(py),
            Event::Imu(sample) => {
                let stamp_ns = sample.header.stamp_ns;
                let values = (stamp_ns, sample.rate_rad_s, sample.acceleration_m_s2);
                ("imu", values).into_bound_py_any(py)
            }
            Event::Twist(twist) => {
                let stamp_ns = twist.header.stamp_ns;
                ("twist", (stamp_ns, twist.velocity, twist.covariance)).into_bound_py_any(py)
            }
            Event::Truth(pose) => {
                ("truth", (pose.header.stamp_ns, pose.pose)).into_bound_py_any(py)
            }
        });
        event.transpose()
    }
}
