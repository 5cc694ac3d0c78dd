//! `sensor_msgs/PointCloud2`: a sweep's returns.

use crate::RADAR;
use crate::definition::Definition;
use crate::pen::{Pen, Style};
use randt_geometry::elementary::sin_cos;
use randt_messages::SweepHead;

/// Its type.
pub const CLOUD: Definition = Definition {
    package: "sensor_msgs",
    name: "PointCloud2",
    md5: "1158d486dd51d683ce2f1be655c3c181",
    text: "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    inside: &[
        "sensor_msgs/PointField\nuint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
    ],
};

/// x, y, z, intensity: viewers that lay clouds out in space want a z.
const STRIDE: usize = 16;
const FLOAT32: u8 = 7;

/// Sine and cosine of each beam's azimuth.
pub fn directions(sweep: &SweepHead) -> Vec<(f64, f64)> {
    let azimuths = sweep.beams().iter();
    azimuths
        .map(|beam| sin_cos(f64::from(beam.azimuth_rad)))
        .collect()
}

/// Points x m, y m, intensity in the radar's frame.
pub fn cloud(
    style: Style,
    sequence: u64,
    stamp_ns: i64,
    points: impl Iterator<Item = [f32; 3]>,
) -> Vec<u8> {
    let mut data = Vec::new();
    for [x_m, y_m, intensity] in points {
        for value in [x_m, y_m, 0.0, intensity] {
            data.extend(value.to_le_bytes());
        }
    }
    let mut pen = Pen::new(style);
    pen.header(sequence, stamp_ns, RADAR);
    pen.u32(1);
    pen.u32((data.len() / STRIDE) as u32);
    pen.u32(4);
    for (name, index) in ["x", "y", "z", "intensity"].iter().zip(0..) {
        pen.string(name);
        pen.u32(4 * index);
        pen.u8(FLOAT32);
        pen.u32(1);
    }
    pen.u8(0);
    pen.u32(STRIDE as u32);
    pen.u32(data.len() as u32);
    pen.blob(&data);
    pen.u8(1);
    pen.end()
}
