//! A topic's layout as a ROS 2 message definition: the schema that a log carries, for readers that
//! are not this program.

use randt_messages::{Layout, Topic, layout::Fields};
use std::fmt::Write as _;

/// The package that our messages belong to.
pub(crate) const PACKAGE: &str = "randt_msgs";
/// What the first line begins with: the layout's name, with its hash, follows.
pub(crate) const LAYOUT: &str = "# layout ";
/// The field that holds the items behind a head.
pub(crate) const ITEMS: &str = "items";
/// What stands between two definitions; rosbag2 has 80 of these.
pub(crate) const SEPARATOR: &str = "=====";
/// What the definition of a struct inside begins with.
pub(crate) const INSIDE: &str = "MSG: ";

/// Rust's numbers and their names in ROS 2.
pub(crate) const NUMBERS: [(&str, &str); 10] = [
    ("u8", "uint8"),
    ("u16", "uint16"),
    ("u32", "uint32"),
    ("u64", "uint64"),
    ("i8", "int8"),
    ("i16", "int16"),
    ("i32", "int32"),
    ("i64", "int64"),
    ("f32", "float32"),
    ("f64", "float64"),
];

/// The name of a topic's messages in ROS 2, as in `randt_msgs/msg/RadarScan`.
pub fn ros_type<T: Topic>() -> String {
    let name = T::TYPE_NAME.split_once('-').map_or("", |(name, _)| name);
    let name = name.strip_suffix("Topic").unwrap_or(name);
    format!("{PACKAGE}/msg/{name}")
}

/// The layout of a topic's messages as a ROS 2 message definition, `ros2msg` in MCAP.
///
/// The message comes first, then each struct inside it, after those that it holds itself. Names of
/// codes are constants in front of their field, which viewers show in place of the number.
///
/// ```
/// let text = randt_log::describe::<randt_messages::RadarScan>();
/// assert!(text.contains("MSG: randt_msgs/Return\nfloat32 range_m\n"));
/// assert!(text.contains("uint32 SENSOR_ISDR_C=1\n"));
/// ```
pub fn describe<T: Topic>() -> String {
    let mut structs: Vec<(&'static str, usize, Fields)> = Vec::new();
    let mut visit = |name: &'static str, size: usize, fields: Fields| {
        if structs.iter().all(|(known, ..)| *known != name) {
            structs.push((name, size, fields));
        }
    };
    T::Head::visit(&mut visit);
    T::Item::visit(&mut visit);
    let size_of_kind = |kind: &str| {
        let number = NUMBERS.iter().find(|(rust, _)| *rust == kind);
        // A number's size is the digits in its name.
        let bits = number.and_then(|(rust, _)| rust.get(1..)?.parse::<usize>().ok());
        let inside = structs.iter().find(|(name, ..)| *name == kind);
        bits.map_or_else(|| inside.map_or(0, |(_, size, _)| *size), |bits| bits / 8)
    };

    let mut text = format!("{LAYOUT}{}, topic {}\n", T::TYPE_NAME, T::NAME);
    let head = structs.iter().find(|(name, ..)| *name == T::Head::NAME);
    if let Some((_, size, fields)) = head {
        write_fields(&mut text, *size, fields, size_of_kind);
    }
    if size_of::<T::Item>() > 0 {
        let (item, most) = (ros_kind(T::Item::NAME), T::MAX_ITEMS);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "# at most {most}\n{item}[] {ITEMS}");
    }
    for (name, size, fields) in structs.iter().filter(|(name, ..)| *name != T::Head::NAME) {
        let separator = "=".repeat(80);
        let _ = writeln!(text, "{separator}\n{INSIDE}{PACKAGE}/{name}");
        write_fields(&mut text, *size, fields, size_of_kind);
    }
    text
}

fn write_fields(text: &mut String, size: usize, fields: Fields, size_of: impl Fn(&str) -> usize) {
    let ends = fields
        .iter()
        .skip(1)
        .map(|field| field.offset)
        .chain([size]);
    for (field, end) in fields.iter().zip(ends) {
        for (code, name) in field.codes {
            let constant = constant(field.name, name);
            let _ = writeln!(text, "uint32 {constant}={code}");
        }
        let kind = match field.kind.strip_prefix('[') {
            None => ros_kind(field.kind),
            // The length may be a constant's name, so it follows from the size.
            Some(array) => {
                let element = array.split(';').next().unwrap_or_default();
                let element = element.rsplit("::").next().unwrap_or_default().trim();
                let count = (end - field.offset).checked_div(size_of(element));
                format!("{}[{}]", ros_kind(element), count.unwrap_or_default())
            }
        };
        let _ = writeln!(text, "{kind} {}", field.name);
    }
}

/// The constant of a code's name: `SENSOR_ISDR_C` for `isdr-c` of the field `sensor`.
fn constant(field: &str, name: &str) -> String {
    format!("{field}_{name}").replace('-', "_").to_uppercase()
}

/// The name of the code that a constant in front of a field stands for.
pub(crate) fn code_name(field: &str, constant: &str) -> Option<String> {
    let name = constant
        .strip_prefix(&field.to_uppercase())?
        .strip_prefix('_')?;
    Some(name.to_lowercase().replace('_', "-"))
}

/// A number's or a struct's name in ROS 2.
fn ros_kind(kind: &str) -> String {
    let name = kind.rsplit("::").next().unwrap_or_default().trim();
    match NUMBERS.iter().find(|(rust, _)| *rust == name) {
        Some((_, ros)) => (*ros).to_owned(),
        None => format!("{PACKAGE}/{name}"),
    }
}
