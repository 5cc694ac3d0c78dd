//! `nav_msgs/OccupancyGrid`.

use crate::MAP;
use crate::definition::{Definition, POINT, POSE_INSIDE, QUATERNION};
use crate::pen::{Pen, Style};

/// Its type.
pub const OCCUPANCY_GRID: Definition = Definition {
    package: "nav_msgs",
    name: "OccupancyGrid",
    md5: "3381f2d731d4076ec5c71b0759edbe4e",
    text: "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n",
    inside: &[
        "nav_msgs/MapMetaData\nbuiltin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\ngeometry_msgs/Pose origin\n",
        POSE_INSIDE,
        POINT,
        QUATERNION,
    ],
};

/// A rectangle of cells in `map`.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// Edge of a cell, m.
    pub cell_m: f64,
    /// The lower left corner, m.
    pub corner_m: [f64; 2],
    /// Cells in a row.
    pub width: usize,
    /// Row by row from below: 0 free to 100 occupied, 255 unknown. ROS's -1 is the same byte.
    pub values: Vec<u8>,
}

/// The grid.
pub fn occupancy_grid(style: Style, stamp_ns: i64, cells: &Cells) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(0, stamp_ns, MAP);
    pen.stamp(stamp_ns);
    pen.f32s(&[cells.cell_m as f32]);
    pen.u32(cells.width as u32);
    let height = cells.values.len().checked_div(cells.width);
    pen.u32(height.unwrap_or_default() as u32);
    let [x_m, y_m] = cells.corner_m;
    pen.pose([x_m, y_m, 0.0]);
    pen.blob(&cells.values);
    pen.end()
}
