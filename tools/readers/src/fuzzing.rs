//! Entries for fuzz targets into what is private otherwise. Not for anything else.

use crate::ros::imu::RosImu;
use crate::ros::navtech::{BScan, Configuration, Fft};
use crate::ros::polar::RosImage;
use crate::ros::{Cloud, Encoding, decode_transforms};

/// Decodes bytes as each message of each serialisation; results are ignored.
pub fn messages(bytes: &[u8]) {
    for encoding in [Encoding::Ros1, Encoding::Cdr] {
        let _ = Cloud::decode(bytes, encoding, None);
        let _ = Cloud::decode_laser_scan(bytes, encoding);
        let _ = Fft::decode(bytes, encoding);
        let _ = BScan::decode(bytes, encoding).map(BScan::polar_image);
        let _ = RosImage::decode(bytes, encoding);
        let _ = Configuration::decode(bytes, encoding);
        let _ = RosImu::decode(bytes, encoding);
        let _ = decode_transforms(bytes, encoding);
    }
}
