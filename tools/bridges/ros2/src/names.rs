//! Names of ROS 2 as DDS has them.

/// A topic's name.
pub fn topic(name: &str) -> String {
    format!("rt{name}")
}

/// The names of a service's two topics: of requests, and of replies.
pub fn service(name: &str) -> [String; 2] {
    [format!("rq{name}Request"), format!("rr{name}Reply")]
}

/// A message's type.
pub fn message_type(package: &str, name: &str) -> String {
    format!("{package}::msg::dds_::{name}_")
}

/// A message's type as ROS writes it, `sensor_msgs/msg/Imu`; as it is where it is none of ROS's.
pub fn ros_type(type_name: &str) -> String {
    let parts = type_name.split_once("::dds_::");
    match parts.and_then(|(package, name)| Some((package, name.strip_suffix('_')?))) {
        Some((package, name)) => format!("{}/{name}", package.replace("::", "/")),
        None => type_name.to_owned(),
    }
}

/// A namespace as it stands before names: none, or with a slash at its beginning alone.
pub fn namespace(text: &str) -> Result<String, String> {
    let text = text.trim_matches('/');
    if text.is_empty() {
        return Ok(String::new());
    }
    let is_word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    match text.split('/').all(is_word) {
        true => Ok(format!("/{text}")),
        false => Err("letters, digits and _, a letter first, / between words".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_come_back_as_they_went() {
        let dds = message_type("sensor_msgs", "PointCloud2");
        assert_eq!(dds, "sensor_msgs::msg::dds_::PointCloud2_");
        assert_eq!(ros_type(&dds), "sensor_msgs/msg/PointCloud2");
        assert_eq!(ros_type("HelloWorld"), "HelloWorld");
        assert_eq!(topic("/tf"), "rt/tf");
    }

    #[test]
    fn a_namespace_has_one_spelling() {
        for text in ["robot/a", "/robot/a", "/robot/a/"] {
            assert_eq!(namespace(text).as_deref(), Ok("/robot/a"));
        }
        assert_eq!(namespace("/").as_deref(), Ok(""));
        assert!(namespace("1st").is_err() && namespace("a//b").is_err());
    }
}
