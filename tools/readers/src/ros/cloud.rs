//! `sensor_msgs/PointCloud2`, as found: fields by name and role, offset and datatype, any step,
//! either byte order.

use super::wire::{Encoding, Malformed, RosHeader, Wire};

/// One finite point in the plane of the radar, with its intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub x_m: f64,
    pub y_m: f64,
    pub intensity: f32,
}

/// The points of one message in its order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cloud {
    pub header: RosHeader,
    pub points: Vec<Point>,
    /// Points left out because a value was NaN or infinite.
    pub not_finite: u32,
    /// The fields' names, where none of them is an intensity: all points are then as strong.
    pub without_intensity: Option<String>,
    /// The field that was taken for the intensity because its name has a word for one in it.
    pub assumed_intensity: Option<String>,
    /// Whether its fields have as many values as the cloud has points, which only Navtech's driver
    /// says: it counts azimuths clockwise as if they were counter-clockwise.
    pub is_navtech: bool,
}

/// Names under which drivers publish the strength of an echo, best first, in lower case.
const INTENSITY_NAMES: [&str; 9] = [
    "intensity",
    "intensities",
    "power",
    "amplitude",
    "magnitude",
    "reflectivity",
    "snr",
    "rcs",
    "i",
];

/// Words in the names of fields that are an intensity in some unit, best first, and words beside
/// which they are none.
const INTENSITY_WORDS: [&str; 7] = [
    "intensity",
    "power",
    "amplitude",
    "magnitude",
    "reflectivity",
    "rcs",
    "snr",
];
const NO_INTENSITY_WORDS: [&str; 4] = ["noise", "var", "cov", "std"];

/// The intensity of returns that have none: above every threshold that sensor.intensity_min can
/// have.
pub(crate) const UNKNOWN_INTENSITY: f32 = 65_536.0;

/// Most points in a message: ten times a sweep's most returns and then some. A larger count is
/// damage.
const MAX_POINTS: usize = 1 << 22;

/// `sensor_msgs/PointField` datatypes 1 to 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Datatype {
    I8 = 1,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Datatype {
    fn from_code(code: u8) -> Option<Self> {
        use Datatype::*;
        let mut all = [I8, U8, I16, U16, I32, U32, F32, F64].into_iter();
        all.find(|datatype| *datatype as u8 == code)
    }

    /// The value at the beginning of `bytes`.
    fn read(self, bytes: &[u8], big_endian: bool) -> Option<f64> {
        fn array<const N: usize>(bytes: &[u8], big_endian: bool) -> Option<[u8; N]> {
            let mut array = *bytes.first_chunk::<N>()?;
            if big_endian {
                array.reverse();
            }
            Some(array)
        }
        Some(match self {
            Self::I8 => f64::from(i8::from_le_bytes(array(bytes, big_endian)?)),
            Self::U8 => f64::from(u8::from_le_bytes(array(bytes, big_endian)?)),
            Self::I16 => f64::from(i16::from_le_bytes(array(bytes, big_endian)?)),
            Self::U16 => f64::from(u16::from_le_bytes(array(bytes, big_endian)?)),
            Self::I32 => f64::from(i32::from_le_bytes(array(bytes, big_endian)?)),
            Self::U32 => f64::from(u32::from_le_bytes(array(bytes, big_endian)?)),
            Self::F32 => f64::from(f32::from_le_bytes(array(bytes, big_endian)?)),
            Self::F64 => f64::from_le_bytes(array(bytes, big_endian)?),
        })
    }
}

/// Where a value stands within a point.
#[derive(Clone, Copy, Debug)]
struct Field {
    offset: usize,
    datatype: Datatype,
}

impl Field {
    fn read(self, point: &[u8], big_endian: bool) -> Option<f64> {
        self.datatype.read(point.get(self.offset..)?, big_endian)
    }
}

/// A field's name, and where it stands unless its datatype is unknown.
type NamedField = (String, Option<Field>);

/// The fields of the message, in its order, and the smallest count of their values.
fn fields(wire: &mut Wire<'_>) -> Result<(Vec<NamedField>, u32), Malformed> {
    let mut fields = Vec::new();
    let mut least = u32::MAX;
    for _ in 0..wire.u32()? {
        let name = wire.string()?;
        let offset = wire.u32()? as usize;
        let datatype = Datatype::from_code(wire.u8()?);
        // No field of ours is an array: drivers set it to 0, 1 or the cloud's width.
        least = least.min(wire.u32()?);
        fields.push((name, datatype.map(|datatype| Field { offset, datatype })));
    }
    Ok((fields, least))
}

/// The fields as a list for people.
fn names(fields: &[NamedField]) -> String {
    let names: Vec<&str> = fields.iter().map(|(name, _)| name.as_str()).collect();
    match names.as_slice() {
        [] => "no field".to_owned(),
        names => names.join(", "),
    }
}

/// The field whose name has a word for an intensity in it, such as `rcs_db`.
fn intensity_by_word(fields: &[NamedField]) -> Option<(String, Field)> {
    INTENSITY_WORDS.into_iter().find_map(|word| {
        fields.iter().find_map(|(name, field)| {
            let lower = name.to_lowercase();
            let is_none = NO_INTENSITY_WORDS.iter().any(|word| lower.contains(word));
            (lower.contains(word) && !is_none).then_some((name.clone(), (*field)?))
        })
    })
}

impl Cloud {
    /// Decodes a message. `intensity_field` names the field to take for the intensity; without it,
    /// or where it is absent, the field is found by the names that drivers use.
    pub fn decode(
        bytes: &[u8],
        encoding: Encoding,
        intensity_field: Option<&str>,
    ) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        let height = wire.u32()? as usize;
        let width = wire.u32()? as usize;

        let (fields, values) = fields(&mut wire)?;
        let big_endian = wire.u8()? != 0;
        let point_step = wire.u32()? as usize;
        let row_step = wire.u32()? as usize;
        let data = wire.bytes()?;

        let named = |wanted: &str| {
            let mut fields = fields.iter();
            fields.find_map(|(name, field)| name.eq_ignore_ascii_case(wanted).then_some(*field)?)
        };
        let missing = |what: &str| {
            let names = names(&fields);
            wire.malformed(format!("no field {what} of a known datatype among {names}"))
        };
        let x = named("x").ok_or_else(|| missing("x"))?;
        let y = named("y").ok_or_else(|| missing("y"))?;
        let intensity = match intensity_field {
            Some(name) => {
                let missing = || missing(&format!("{name} (--intensity-field)"));
                Some(named(name).ok_or_else(missing)?)
            }
            None => INTENSITY_NAMES.into_iter().find_map(named),
        };
        let by_word = match intensity {
            None => intensity_by_word(&fields),
            Some(_) => None,
        };
        let intensity = intensity.or(by_word.as_ref().map(|(_, field)| *field));
        let count = height
            .checked_mul(width)
            .filter(|count| *count <= MAX_POINTS);
        let count = count.ok_or_else(|| wire.malformed("width x height above 4 million"))?;
        // A row step of 0 is a common omission in clouds of one row.
        let row_step = if height <= 1 { data.len() } else { row_step };
        if count > 0 && (point_step == 0 || row_step < width.saturating_mul(point_step)) {
            return Err(wire.malformed("row_step shorter than width x point_step"));
        }

        let mut cloud = Self {
            header,
            points: Vec::with_capacity(count.min(data.len())),
            not_finite: 0,
            without_intensity: intensity.is_none().then(|| names(&fields)),
            assumed_intensity: by_word.map(|(name, _)| name),
            is_navtech: values > 1 && values as usize == width,
        };
        for index in 0..count {
            let start = (index / width) * row_step + (index % width) * point_step;
            let point = data.get(start..).and_then(|rest| {
                let point = rest.get(..point_step.min(rest.len()))?;
                Some(Point {
                    x_m: x.read(point, big_endian)?,
                    y_m: y.read(point, big_endian)?,
                    intensity: match intensity {
                        Some(intensity) => intensity.read(point, big_endian)? as f32,
                        None => UNKNOWN_INTENSITY,
                    },
                })
            });
            let point = point.ok_or_else(|| wire.malformed("fewer points than width x height"))?;
            if point.x_m.is_finite() && point.y_m.is_finite() && point.intensity.is_finite() {
                cloud.points.push(point);
            } else {
                cloud.not_finite += 1;
            }
        }
        Ok(cloud)
    }
}
