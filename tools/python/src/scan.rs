//! A sweep of the radar, from arrays and as arrays.

use crate::configuration::value_error;
use pyo3::types::PyBytes;
use pyo3::{Bound, PyResult, Python, pyclass, pymethods};
use randt_messages::{Beam, MAX_BEAMS, MAX_RETURNS, Message, RadarScan, Return};
use std::borrow::Cow;

/// One sweep.
#[pyclass(frozen, module = "randt._randt")]
pub struct Scan(pub Message<RadarScan>);

#[pymethods]
impl Scan {
    /// Beams in order of time, returns by beam; the bytes are little-endian arrays: f32 azimuths
    /// and i64 stamps of beams, f32 ranges and intensities and u16 beams of returns.
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "arrays by name: Python's own form"
    )]
    fn new(
        azimuth_rad: &[u8],
        beam_stamp_ns: &[u8],
        range_m: &[u8],
        intensity: &[u8],
        beam: &[u8],
        range_resolution_m: f32,
        azimuth_step_rad: f32,
        span_ns: Option<(i64, i64)>,
    ) -> PyResult<Self> {
        let azimuth_rad: Cow<'_, [f32]> = values(azimuth_rad);
        let beam_stamp_ns: Cow<'_, [i64]> = values(beam_stamp_ns);
        let range_m: Cow<'_, [f32]> = values(range_m);
        let intensity: Cow<'_, [f32]> = values(intensity);
        let beam: Cow<'_, [u16]> = values(beam);
        let (beams, returns) = (azimuth_rad.len(), range_m.len());
        if !(3..=MAX_BEAMS).contains(&beams) || beam_stamp_ns.len() != beams {
            return Err(value_error(format!(
                "{beams} azimuths and {} stamps: a sweep has 3 to {MAX_BEAMS} beams",
                beam_stamp_ns.len()
            )));
        }
        if returns > MAX_RETURNS || intensity.len() != returns || beam.len() != returns {
            return Err(value_error(format!(
                "{returns} ranges, {} intensities, {} beams: a sweep has up to {MAX_RETURNS} returns",
                intensity.len(),
                beam.len()
            )));
        }
        if !beam.is_sorted() || beam.last().is_some_and(|last| usize::from(*last) >= beams) {
            return Err(value_error(format!(
                "returns are not sorted by beam, or one is of a beam from {beams} on"
            )));
        }
        if !beam_stamp_ns.is_sorted() {
            return Err(value_error("beams are not in order of time"));
        }
        if !(range_resolution_m > 0.0 && range_resolution_m.is_finite()) {
            return Err(value_error(format!(
                "range_resolution_m is {range_resolution_m}: above 0"
            )));
        }
        let first_ns = beam_stamp_ns.first().copied().unwrap_or_default();
        let last_ns = beam_stamp_ns.last().copied().unwrap_or_default();
        let (begin_ns, end_ns) = span_ns.unwrap_or((first_ns, last_ns));
        if begin_ns > first_ns || end_ns < last_ns {
            return Err(value_error(format!(
                "beams from {first_ns} to {last_ns} ns are not within the sweep, {begin_ns} to {end_ns} ns"
            )));
        }
        let mut message = Message::<RadarScan>::default();
        let items = range_m.iter().zip(&*intensity).zip(&*beam);
        message.items = items
            .map(|((range_m, intensity), beam)| Return {
                range_m: *range_m,
                intensity: *intensity,
                beam: *beam,
                bin: (range_m / range_resolution_m) as u16,
            })
            .collect();
        let head = &mut *message.head;
        let table = azimuth_rad.iter().zip(&*beam_stamp_ns).enumerate();
        for ((index, (azimuth_rad, stamp_ns)), entry) in table.zip(head.sweep.beams.iter_mut()) {
            let first = beam.partition_point(|of| usize::from(*of) < index);
            *entry = Beam {
                stamp_ns: *stamp_ns,
                azimuth_rad: *azimuth_rad,
                first_return: first as u32,
            };
        }
        (head.sweep.begin_ns, head.sweep.end_ns) = (begin_ns, end_ns);
        head.sweep.beam_count = beams as u32;
        head.sweep.range_resolution_m = range_resolution_m;
        head.sweep.azimuth_step_rad = azimuth_step_rad;
        head.header.stamp_ns = head.sweep.end_ns;
        Ok(Self(message))
    }

    #[getter]
    fn stamp_ns(&self) -> i64 {
        self.0.head.header.stamp_ns
    }

    #[getter]
    fn span_ns(&self) -> (i64, i64) {
        (self.0.head.sweep.begin_ns, self.0.head.sweep.end_ns)
    }

    #[getter]
    fn range_resolution_m(&self) -> f32 {
        self.0.head.sweep.range_resolution_m
    }

    #[getter]
    fn azimuth_step_rad(&self) -> f32 {
        self.0.head.sweep.azimuth_step_rad
    }

    fn azimuth_rad<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let beams = self.0.head.sweep.beams().iter();
        bytes(
            py,
            &beams.map(|beam| beam.azimuth_rad).collect::<Vec<f32>>(),
        )
    }

    fn beam_stamp_ns<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let beams = self.0.head.sweep.beams().iter();
        bytes(py, &beams.map(|beam| beam.stamp_ns).collect::<Vec<i64>>())
    }

    fn range_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let returns = self.0.items.iter();
        bytes(py, &returns.map(|item| item.range_m).collect::<Vec<f32>>())
    }

    fn intensity<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let returns = self.0.items.iter();
        bytes(
            py,
            &returns.map(|item| item.intensity).collect::<Vec<f32>>(),
        )
    }

    fn beam<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let returns = self.0.items.iter();
        bytes(py, &returns.map(|item| item.beam).collect::<Vec<u16>>())
    }
}

/// The values in an array's bytes: where they lie, if they are aligned there, as Python's are.
fn values<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(bytes: &[u8]) -> Cow<'_, [T]> {
    bytemuck::try_cast_slice(bytes).map_or_else(
        |_| Cow::Owned(bytemuck::pod_collect_to_vec(bytes)),
        Cow::Borrowed,
    )
}

/// An array's bytes.
fn bytes<'py, T: bytemuck::NoUninit>(py: Python<'py>, values: &[T]) -> Bound<'py, PyBytes> {
    PyBytes::new(py, bytemuck::cast_slice(values))
}
