//! A message that matters, before it gets its number.

use crate::polar_image::PolarImage;
use crate::ros::Cloud;
use crate::ros::imu::RosImu;
use crate::ros::navtech::{BScan, Fft, FftTurn};
use crate::ros::polar::RosImage;
use crate::ros::recording::RadarKind;
use crate::ros::transform::Transform;
use crate::ros::twist::{RosTwist, TwistKind};
use crate::ros::wire::{Encoding, Malformed, RosHeader, Wire};

/// A decoded message.
pub(super) enum Decoded {
    Cloud(Cloud),
    Polar(RosHeader, PolarImage),
    Imu(RosImu),
    Twist(RosTwist),
    Transforms(Vec<Transform>),
}

impl Decoded {
    /// A radar's message; `None` where a turn is not over yet. `intensity_field` is for clouds,
    /// the unfinished turn and its encoder's counts for azimuths.
    pub fn radar(
        bytes: &[u8],
        encoding: Encoding,
        (kind, intensity_field): (RadarKind, Option<&str>),
        fft_turn: &mut FftTurn,
        encoder_turn: Option<u16>,
    ) -> Result<Option<Self>, Malformed> {
        let refused = |why: String| match Wire::new(bytes, encoding) {
            Ok(wire) => wire.malformed(why),
            Err(malformed) => malformed,
        };
        Ok(Some(match kind {
            RadarKind::Cloud => Self::Cloud(Cloud::decode(bytes, encoding, intensity_field)?),
            RadarKind::LaserScan => Self::Cloud(Cloud::decode_laser_scan(bytes, encoding)?),
            RadarKind::Image => {
                let RosImage {
                    header,
                    width,
                    height,
                    pixels,
                } = RosImage::decode(bytes, encoding)?;
                let image = PolarImage::from_pixels(pixels, width, height).map_err(refused)?;
                Self::Polar(header, image)
            }
            RadarKind::BScan => {
                let scan = BScan::decode(bytes, encoding)?;
                let header = scan.image.header.clone();
                Self::Polar(header, scan.polar_image().map_err(refused)?)
            }
            RadarKind::Fft => {
                let fft = Fft::decode(bytes, encoding)?;
                return match fft_turn.push(&fft, encoder_turn) {
                    Some(turn) => Self::fft_turn(turn).map(Some).map_err(refused),
                    None => Ok(None),
                };
            }
        }))
    }

    /// A turn of single azimuths.
    pub fn fft_turn((frame, image): (String, Result<PolarImage, String>)) -> Result<Self, String> {
        let image = image?;
        let stamp_ns = image.rows().last().map_or(0, |row| row.time);
        Ok(Self::Polar(RosHeader { stamp_ns, frame }, image))
    }

    pub fn imu(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        RosImu::decode(bytes, encoding).map(Self::Imu)
    }

    pub fn twist(bytes: &[u8], encoding: Encoding, kind: TwistKind) -> Result<Self, Malformed> {
        RosTwist::decode(bytes, encoding, kind).map(Self::Twist)
    }

    /// Which stream it is of: radar, IMU, twists; and its stamp, ns.
    pub fn stream(&self) -> Option<(usize, i64)> {
        match self {
            Self::Cloud(cloud) => Some((0, cloud.header.stamp_ns)),
            Self::Polar(header, _) => Some((0, header.stamp_ns)),
            Self::Imu(imu) => Some((1, imu.header.stamp_ns)),
            Self::Twist(twist) => Some((2, twist.header.stamp_ns)),
            Self::Transforms(_) => None,
        }
    }

    pub fn frame(&self) -> Option<&str> {
        Some(match self {
            Self::Cloud(cloud) => &cloud.header.frame,
            Self::Polar(header, _) => &header.frame,
            Self::Imu(imu) => &imu.header.frame,
            Self::Twist(twist) => &twist.header.frame,
            Self::Transforms(_) => return None,
        })
    }

    pub fn header_mut(&mut self) -> Option<&mut RosHeader> {
        Some(match self {
            Self::Cloud(cloud) => &mut cloud.header,
            Self::Polar(header, _) => header,
            Self::Imu(imu) => &mut imu.header,
            Self::Twist(twist) => &mut twist.header,
            Self::Transforms(_) => return None,
        })
    }
}
