//! Our messages as ROS's, in both of its serialisations.

use randt_geometry::Quaternion;
use randt_geometry::elementary::sin_cos;
use randt_log::{Entry, Robot};
use randt_messages::{
    Correction, ImuSample, ImuSampleTopic, MapperCorrection, MessageRef, OdometryState,
    OdometryStateTopic, RadarScan,
};

/// Names of frames, as REP-105 has them.
const RADAR: &str = "radar";
const IMU: &str = "imu";
const BASE_LINK: &str = "base_link";

/// A type of ROS messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Type {
    /// Package and name.
    pub package: &'static str,
    pub name: &'static str,
    /// What ROS 1 compares before it connects.
    pub md5: &'static str,
    /// The definition, without those of the types inside.
    text: &'static str,
    /// Types inside: the name, then the definition.
    inside: &'static [&'static str],
}

const POINT_FIELD: &str = "sensor_msgs/PointField\nuint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n";
const VECTOR: &str = "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
const POINT: &str = "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";

const CLOUD: Type = Type {
    package: "sensor_msgs",
    name: "PointCloud2",
    md5: "1158d486dd51d683ce2f1be655c3c181",
    text: "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    inside: &[POINT_FIELD],
};
const SAMPLE: Type = Type {
    package: "sensor_msgs",
    name: "Imu",
    md5: "6a62c6daae103f4ff57a132d6f95cec2",
    text: "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    inside: &[QUATERNION, VECTOR],
};
const TRANSFORMS: Type = Type {
    package: "tf2_msgs",
    name: "TFMessage",
    md5: "94810edda583a504dfda3829e70d7eec",
    text: "geometry_msgs/TransformStamped[] transforms\n",
    inside: &[
        "geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        "geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        VECTOR,
        QUATERNION,
    ],
};
const ODOMETRY: Type = Type {
    package: "nav_msgs",
    name: "Odometry",
    md5: "cd5e73d190d741a2f92e81eda573aca7",
    text: "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    inside: &[
        "geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n",
        "geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        POINT,
        QUATERNION,
        "geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n",
        "geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        VECTOR,
    ],
};

impl Type {
    /// The whole definition, as bags carry it.
    pub fn definition(&self, style: Style) -> String {
        let mut text = self.text.to_owned();
        let header: &[&str] = match style {
            Style::Ros1 => &["std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"],
            Style::Cdr => &[
                "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
                "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
            ],
        };
        for inside in self.inside.iter().chain(header) {
            text += &"=".repeat(80);
            text += &format!("\nMSG: {inside}");
        }
        text
    }
}

/// How ROS serialises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// ROS 1: packed.
    Ros1,
    /// ROS 2: CDR, little-endian, aligned.
    Cdr,
}

/// One message of ROS.
#[derive(Debug)]
pub struct Message {
    pub topic: &'static str,
    pub stamp_ns: i64,
    pub bytes: Vec<u8>,
}

/// Topics of the bags.
pub const TOPICS: [(&str, Type); 5] = [
    ("/radar/returns", CLOUD),
    ("/imu/data", SAMPLE),
    ("/odometry", ODOMETRY),
    ("/tf", TRANSFORMS),
    ("/tf_static", TRANSFORMS),
];

/// Turns our messages into ROS's.
#[derive(Debug)]
pub struct Translator {
    style: Style,
    /// Until its mounting is given out.
    robot: Option<Robot>,
    correction: Option<Correction>,
    last_state: Option<u64>,
}

impl Translator {
    pub fn new(style: Style, robot: Robot) -> Self {
        Self {
            style,
            robot: Some(robot),
            correction: None,
            last_state: None,
        }
    }

    /// Where the sensors sit; unknown mountings are none.
    fn mounting(&self, robot: &Robot, stamp_ns: i64) -> Message {
        let [x, y, yaw] = robot.radar.unwrap_or_default();
        let [w, qx, qy, qz] = robot.imu.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let radar = (BASE_LINK, RADAR, [x, y], about_z(yaw));
        let imu = (BASE_LINK, IMU, [0.0; 2], [qx, qy, qz, w]);
        self.transforms("/tf_static", stamp_ns, &[radar, imu])
    }

    /// What a message becomes; the mounting stands before all else.
    pub fn translate(&mut self, entry: &Entry<'_>) -> Result<Vec<Message>, randt_log::Error> {
        let mut messages = self.translate_one(entry)?;
        if let Some(stamp_ns) = messages.first().map(|first| first.stamp_ns)
            && let Some(robot) = self.robot.take()
        {
            messages.insert(0, self.mounting(&robot, stamp_ns));
        }
        Ok(messages)
    }

    fn translate_one(&mut self, entry: &Entry<'_>) -> Result<Vec<Message>, randt_log::Error> {
        if let Some(scan) = entry.decode::<RadarScan>()? {
            return Ok(vec![self.cloud(scan.as_ref())]);
        }
        if let Some(sample) = entry.decode::<ImuSampleTopic>()? {
            return Ok(vec![self.sample(&sample.head)]);
        }
        if let Some(correction) = entry.decode::<MapperCorrection>()? {
            self.correction = Some(*correction.head);
        }
        match entry.decode::<OdometryStateTopic>()? {
            // A stage that came back sends its last states again.
            Some(state) if self.last_state.is_none_or(|last| state.head.id > last) => {
                self.last_state = Some(state.head.id);
                Ok(self.state(&state.head))
            }
            _ => Ok(Vec::new()),
        }
    }

    fn cloud(&self, scan: MessageRef<'_, RadarScan>) -> Message {
        let stamp_ns = scan.head.header.stamp_ns;
        let mut pen = Pen::new(self.style);
        pen.header(scan.head.header.sequence, stamp_ns, RADAR);
        let beams = scan.head.sweep.beams().iter();
        let directions: Vec<_> = beams
            .map(|beam| sin_cos(f64::from(beam.azimuth_rad)))
            .collect();
        let mut data = Vec::with_capacity(scan.items.len() * 16);
        for point in scan.items {
            let Some((sine, cosine)) = directions.get(usize::from(point.beam)) else {
                continue;
            };
            let range_m = f64::from(point.range_m);
            for value in [range_m * cosine, range_m * sine, 0.0] {
                data.extend((value as f32).to_le_bytes());
            }
            data.extend(point.intensity.to_le_bytes());
        }
        pen.u32(1);
        pen.u32((data.len() / 16) as u32);
        pen.u32(4);
        for (name, index) in ["x", "y", "z", "intensity"].iter().zip(0..) {
            pen.string(name);
            pen.u32(4 * index);
            pen.u8(7); // FLOAT32
            pen.u32(1);
        }
        pen.u8(0);
        pen.u32(16);
        pen.u32(data.len() as u32);
        pen.blob(&data);
        pen.u8(1);
        pen.end("/radar/returns", stamp_ns)
    }

    fn sample(&self, sample: &ImuSample) -> Message {
        let stamp_ns = sample.header.stamp_ns;
        let mut pen = Pen::new(self.style);
        pen.header(sample.header.sequence, stamp_ns, IMU);
        // A first covariance of -1 means that there is no orientation.
        pen.f64s(&[0.0; 4]);
        pen.f64s(&[-1.0]);
        pen.f64s(&[0.0; 8]);
        pen.f64s(&sample.rate_rad_s);
        pen.f64s(&[0.0; 9]);
        pen.f64s(&sample.acceleration_m_s2);
        pen.f64s(&[0.0; 9]);
        pen.end("/imu/data", stamp_ns)
    }

    fn state(&self, state: &OdometryState) -> Vec<Message> {
        let stamp_ns = state.header.stamp_ns;
        let [x, y, yaw] = state.pose;
        let mut pen = Pen::new(self.style);
        pen.header(state.id, stamp_ns, "odom");
        pen.string(BASE_LINK);
        pen.f64s(&[x, y, 0.0]);
        pen.f64s(&about_z(yaw));
        pen.f64s(&in_six(&state.covariance));
        let [forward, left, rate] = state.velocity;
        pen.f64s(&[forward, left, 0.0, 0.0, 0.0, rate]);
        pen.f64s(&[0.0; 36]);
        let mut transforms = vec![("odom", BASE_LINK, [x, y], about_z(yaw))];
        let of_frame = |c: &Correction| c.odom_frame_id == state.odom_frame_id;
        if let Some(correction) = self.correction.filter(of_frame) {
            let [x, y, yaw] = correction.map_from_odom;
            transforms.push(("map", "odom", [x, y], about_z(yaw)));
        }
        vec![
            pen.end("/odometry", stamp_ns),
            self.transforms("/tf", stamp_ns, &transforms),
        ]
    }

    fn transforms(
        &self,
        topic: &'static str,
        stamp_ns: i64,
        transforms: &[(&str, &str, [f64; 2], [f64; 4])],
    ) -> Message {
        let mut pen = Pen::new(self.style);
        pen.u32(transforms.len() as u32);
        for (parent, child, [x, y], rotation) in transforms {
            pen.header(0, stamp_ns, parent);
            pen.string(child);
            pen.f64s(&[*x, *y, 0.0]);
            pen.f64s(rotation);
        }
        pen.end(topic, stamp_ns)
    }
}

/// A quaternion x, y, z, w.
fn about_z(yaw_rad: f64) -> [f64; 4] {
    let [w, x, y, z] = Quaternion::from_roll_pitch_yaw(0.0, 0.0, yaw_rad).to_array();
    [x, y, z, w]
}

/// A covariance of x, y, yaw as ROS has it: x, y, z and three rotations.
fn in_six(covariance: &[f64; 9]) -> [f64; 36] {
    const INDICES: [usize; 3] = [0, 1, 5];
    let mut six = [0.0; 36];
    for (row, to_row) in INDICES.iter().enumerate() {
        for (column, to_column) in INDICES.iter().enumerate() {
            let from = covariance.get(3 * row + column);
            if let (Some(to), Some(from)) = (six.get_mut(6 * to_row + to_column), from) {
                *to = *from;
            }
        }
    }
    six
}

/// Serialises.
struct Pen {
    bytes: Vec<u8>,
    style: Style,
}

impl Pen {
    fn new(style: Style) -> Self {
        let bytes = match style {
            Style::Ros1 => Vec::new(),
            // Little-endian.
            Style::Cdr => vec![0, 1, 0, 0],
        };
        Self { bytes, style }
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        // Alignment counts from behind the four bytes that name the kind of CDR.
        while self.style == Style::Cdr && !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(bytes);
    }

    fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.put(value.to_le_bytes());
        }
    }

    fn blob(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
    }

    fn string(&mut self, text: &str) {
        let end = match self.style {
            Style::Ros1 => "",
            Style::Cdr => "\0",
        };
        self.blob(format!("{text}{end}").as_bytes());
    }

    fn header(&mut self, sequence: u64, stamp_ns: i64, frame: &str) {
        if self.style == Style::Ros1 {
            self.u32(sequence as u32);
        }
        let [seconds, nanoseconds] = time(stamp_ns);
        self.u32(seconds);
        self.u32(nanoseconds);
        self.string(frame);
    }

    fn end(self, topic: &'static str, stamp_ns: i64) -> Message {
        Message {
            topic,
            stamp_ns,
            bytes: self.bytes,
        }
    }
}

/// Seconds and nanoseconds; ROS's time begins in 1970.
pub fn time(stamp_ns: i64) -> [u32; 2] {
    let seconds = stamp_ns.div_euclid(1_000_000_000);
    let nanoseconds = stamp_ns.rem_euclid(1_000_000_000);
    [u32::try_from(seconds).unwrap_or(0), nanoseconds as u32]
}
