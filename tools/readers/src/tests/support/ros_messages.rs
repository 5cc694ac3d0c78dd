//! ROS messages as bytes, small and only for tests.

use crate::ros::Encoding;

/// How a test serialises: the mirror image of `Wire`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Style {
    Ros1,
    CdrLittle,
    CdrBig,
}

impl Style {
    pub fn encoding(self) -> Encoding {
        if self == Self::Ros1 {
            Encoding::Ros1
        } else {
            Encoding::Cdr
        }
    }
}

pub struct Pen {
    pub bytes: Vec<u8>,
    style: Style,
}

impl Pen {
    pub fn new(style: Style) -> Self {
        let bytes = match style {
            Style::Ros1 => vec![],
            Style::CdrLittle => vec![0, 1, 0, 0],
            Style::CdrBig => vec![0, 0, 0, 0],
        };
        Self { bytes, style }
    }

    fn put<const N: usize>(&mut self, mut little: [u8; N]) {
        if self.style != Style::Ros1 {
            while !(self.bytes.len() - 4).is_multiple_of(N) {
                self.bytes.push(0);
            }
        }
        if self.style == Style::CdrBig {
            little.reverse();
        }
        self.bytes.extend(little);
    }

    pub fn u8(&mut self, value: u8) {
        self.put([value]);
    }
    pub fn u16(&mut self, value: u16) {
        self.put(value.to_le_bytes());
    }
    pub fn f32(&mut self, value: f32) {
        self.put(value.to_le_bytes());
    }
    pub fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }
    pub fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }
    pub fn blob(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
    }
    pub fn string(&mut self, text: &str) {
        if self.style == Style::Ros1 {
            self.blob(text.as_bytes());
        } else {
            self.blob(format!("{text}\0").as_bytes());
        }
    }
    pub fn header(&mut self, stamp_ns: i64, frame: &str) {
        if self.style == Style::Ros1 {
            self.u32(7);
        }
        self.u32((stamp_ns / 1_000_000_000) as u32);
        self.u32((stamp_ns % 1_000_000_000) as u32);
        self.string(frame);
    }
}

/// How a cloud's points are laid out.
#[derive(Clone, Debug)]
pub struct CloudLayout {
    pub point_step: usize,
    /// Offsets of x, y, z, intensity.
    pub offsets: [usize; 4],
    pub big_endian: bool,
    /// 7 for f32, 8 for f64.
    pub datatype: u8,
    pub row_padding: usize,
    pub rows: usize,
    pub intensity_name: &'static str,
    /// Values that each field says it has.
    pub values: u32,
}

impl CloudLayout {
    /// As the published data set has it.
    pub const AS_PUBLISHED: Self = Self {
        point_step: 16,
        offsets: [0, 4, 8, 12],
        big_endian: false,
        datatype: 7,
        row_padding: 0,
        rows: 1,
        intensity_name: "intensity",
        values: 1,
    };
}

/// A cloud of (x, y, intensity).
#[derive(Clone, Debug)]
pub struct TestCloud {
    pub stamp_ns: i64,
    pub points: Vec<(f64, f64, f64)>,
}

impl TestCloud {
    pub fn serialise(&self, style: Style, layout: &CloudLayout) -> Vec<u8> {
        let mut pen = Pen::new(style);
        pen.header(self.stamp_ns, "left_radar_link");
        let rows = if layout.rows > 0 && self.points.len().is_multiple_of(layout.rows) {
            layout.rows
        } else {
            1
        };
        let width = self.points.len() / rows;
        pen.u32(rows as u32);
        pen.u32(width as u32);
        let names = ["x", "y", "z", layout.intensity_name];
        pen.u32(5);
        // A field that is not used, of an unknown datatype.
        pen.string("elevation_index");
        pen.u32(1);
        pen.u8(200);
        pen.u32(layout.values);
        for (name, offset) in names.iter().zip(layout.offsets) {
            pen.string(name);
            pen.u32(offset as u32);
            pen.u8(layout.datatype);
            pen.u32(layout.values);
        }
        pen.u8(u8::from(layout.big_endian));
        pen.u32(layout.point_step as u32);
        let row_step = width * layout.point_step + layout.row_padding;
        pen.u32(row_step as u32);
        let mut data = vec![0xa5; rows * row_step];
        for (index, (x, y, intensity)) in self.points.iter().enumerate() {
            let start = index / width * row_step + index % width * layout.point_step;
            for (value, offset) in [*x, *y, 0.0, *intensity].into_iter().zip(layout.offsets) {
                let mut bytes = if layout.datatype == 7 {
                    (value as f32).to_le_bytes().to_vec()
                } else {
                    value.to_le_bytes().to_vec()
                };
                if layout.big_endian {
                    bytes.reverse();
                }
                data[start + offset..start + offset + bytes.len()].copy_from_slice(&bytes);
            }
        }
        pen.blob(&data);
        pen.u8(1);
        pen.bytes
    }
}

/// An IMU message as drivers without orientation send it.
pub fn imu(style: Style, stamp_ns: i64, rate: [f64; 3], acceleration: [f64; 3]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(stamp_ns, "imu_link");
    for value in [0.0; 4] {
        pen.f64(value);
    }
    pen.f64(-1.0);
    (0..8).for_each(|_| pen.f64(0.0));
    rate.iter().for_each(|value| pen.f64(*value));
    (0..9).for_each(|_| pen.f64(0.0));
    acceleration.iter().for_each(|value| pen.f64(*value));
    (0..9).for_each(|_| pen.f64(0.0));
    pen.bytes
}

/// An odometry message of wheels: forward, left, yaw rate, with variances of 1, 2 and 6
/// hundredths.
pub fn odometry(style: Style, stamp_ns: i64, velocity: [f64; 3]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(stamp_ns, "odom");
    pen.string("base_link");
    (0..7 + 36).for_each(|i| pen.f64(f64::from(i)));
    twist_with_covariance(&mut pen, velocity);
    pen.bytes
}

/// A twist without covariance, or with it.
pub fn twist(style: Style, stamp_ns: i64, velocity: [f64; 3], covariance: bool) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(stamp_ns, "base_link");
    match covariance {
        true => twist_with_covariance(&mut pen, velocity),
        false => axes(velocity).iter().for_each(|value| pen.f64(*value)),
    }
    pen.bytes
}

fn axes([forward, left, yaw_rate]: [f64; 3]) -> [f64; 6] {
    [forward, left, 9.0, 9.0, 9.0, yaw_rate]
}

fn twist_with_covariance(pen: &mut Pen, velocity: [f64; 3]) {
    axes(velocity).iter().for_each(|value| pen.f64(*value));
    for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
        let variance = 0.01 * f64::from(row + 1);
        pen.f64(if row == column { variance } else { 0.0 });
    }
}

/// (parent, child, translation, quaternion x y z w).
pub type TestTransform = (&'static str, &'static str, [f64; 3], [f64; 4]);

pub fn transforms(style: Style, transforms: &[TestTransform]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.u32(transforms.len() as u32);
    for (parent, child, translation, rotation) in transforms {
        pen.header(0, parent);
        pen.string(child);
        translation
            .iter()
            .chain(rotation)
            .for_each(|value| pen.f64(*value));
    }
    pen.bytes
}

/// A message on its way into a bag.
#[derive(Clone, Debug)]
pub struct TestMessage {
    pub topic: &'static str,
    /// In ROS 1's spelling.
    pub type_name: &'static str,
    pub arrival_ns: i64,
    pub bytes: Vec<u8>,
}

pub const CLOUD: &str = "sensor_msgs/PointCloud2";
pub const ODOMETRY: &str = "nav_msgs/Odometry";
pub const TWIST: &str = "geometry_msgs/TwistStamped";
pub const TWIST_WITH_COVARIANCE: &str = "geometry_msgs/TwistWithCovarianceStamped";
pub const IMU: &str = "sensor_msgs/Imu";
pub const TF: &str = "tf2_msgs/TFMessage";
