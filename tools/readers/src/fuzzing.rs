//! Entries for fuzz targets into what is private otherwise. Not for anything else.

use crate::ros::imu::RosImu;
use crate::ros::{Cloud, Encoding, decode_transforms};

/// Decodes bytes as each message of each serialisation; results are ignored.
pub fn messages(bytes: &[u8]) {
    for encoding in [Encoding::Ros1, Encoding::Cdr] {
        let _ = Cloud::decode(bytes, encoding);
        let _ = RosImu::decode(bytes, encoding);
        let _ = decode_transforms(bytes, encoding);
    }
}
