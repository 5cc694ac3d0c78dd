//! `visualization_msgs/MarkerArray`: drawings for viewers.

use crate::definition::{Definition, POINT, POSE_INSIDE, QUATERNION, VECTOR};
use crate::pen::{Pen, Style};

/// Its type, as ROS 2 Humble and later have it.
pub const MARKERS: Definition = Definition {
    package: "visualization_msgs",
    name: "MarkerArray",
    md5: "",
    text: "visualization_msgs/Marker[] markers\n",
    inside: &[
        "visualization_msgs/Marker\nint32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\nint32 LINE_LIST=5\nint32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\nstd_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\nsensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
        "std_msgs/ColorRGBA\nfloat32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
        "builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n",
        "sensor_msgs/CompressedImage\nstd_msgs/Header header\nstring format\nuint8[] data\n",
        "visualization_msgs/UVCoordinate\nfloat32 u\nfloat32 v\n",
        "visualization_msgs/MeshFile\nstring filename\nuint8[] data\n",
        POSE_INSIDE,
        POINT,
        QUATERNION,
        VECTOR,
    ],
};

const LINE_WIDTH_M: f64 = 0.05;
const DISC_HEIGHT_M: f64 = 0.01;

/// What a marker shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through all points, m.
    Strip(Vec<[f64; 2]>),
    /// Pairs of points, m, each point in a colour of its own.
    Lines(Vec<[f64; 2]>, Vec<[f32; 4]>),
    /// An ellipse: its pose (x m, y m, yaw rad), and how long and wide it is, m.
    Disc([f64; 3], [f64; 2]),
}

/// A drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// What it shows.
    pub shape: Shape,
    /// Red, green, blue, alpha, from 0 to 1.
    pub colour: [f32; 4],
}

/// Markers in a frame, with which they move. They replace all that the topic has shown.
pub fn markers(style: Style, stamp_ns: i64, frame: &str, name: &str, shown: &[Marker]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.u32(shown.len() as u32 + 1);
    let clear = Marker {
        shape: Shape::Strip(Vec::new()),
        colour: [0.0; 4],
    };
    put(&mut pen, (stamp_ns, frame, name), (0, 3), &clear);
    for (marker, id) in shown.iter().zip(1..) {
        put(&mut pen, (stamp_ns, frame, name), (id, 0), marker);
    }
    pen.end()
}

fn put(
    pen: &mut Pen,
    (stamp_ns, frame, name): (i64, &str, &str),
    (id, action): (u32, u32),
    marker: &Marker,
) {
    pen.header(0, stamp_ns, frame);
    pen.string(name);
    pen.u32(id);
    let nothing: (&[_], &[_]) = (&[], &[]);
    let (kind, pose, scale, (points, colours)) = match &marker.shape {
        Shape::Strip(points) => (
            4,
            [0.0; 3],
            [LINE_WIDTH_M, 0.0, 0.0],
            (&**points, nothing.1),
        ),
        Shape::Lines(points, colours) => {
            let scale = [LINE_WIDTH_M, 0.0, 0.0];
            (5, [0.0; 3], scale, (&**points, &**colours))
        }
        Shape::Disc(pose, [long_m, wide_m]) => {
            (3, *pose, [*long_m, *wide_m, DISC_HEIGHT_M], nothing)
        }
    };
    pen.u32(kind);
    pen.u32(action);
    pen.pose(pose);
    pen.f64s(&scale);
    pen.f32s(&marker.colour);
    // For ever, and with its frame.
    pen.u32(0);
    pen.u32(0);
    pen.u8(1);
    pen.u32(points.len() as u32);
    for [x_m, y_m] in points {
        pen.f64s(&[*x_m, *y_m, 0.0]);
    }
    pen.u32(colours.len() as u32);
    for colour in colours {
        pen.f32s(colour);
    }
    // No texture, no text, no mesh.
    pen.string("");
    pen.header(0, 0, "");
    pen.string("");
    pen.u32(0);
    pen.u32(0);
    pen.string("");
    pen.string("");
    pen.string("");
    pen.u32(0);
    pen.u8(0);
}
