//! An IMU to imu/sample: Phidgets Spatial by the vendor's library, MicroStrain MIP and Xsens
//! MTData2 on serial ports, any other by text lines; and the robot's velocity by such lines to
//! robot/twist.
//!
//! Responsible for reaching the device and for reaching it again after anything, for SI units,
//! axes and stamps in the one clock. Not responsible for attitude, bias or filtering: odometry
//! does that.
//!
//! [`Imu`] is the whole driver without a process. The codecs ([`mip`], [`xsens`], [`mod@line`]) are
//! pure and go both ways, because the emulators speak with them. This was never run with a device.
//! It is tested against emulators, and the Phidgets' part with the vendor's own library.

mod axes;
mod bytes;
pub mod command_sequence;
mod error;
pub mod frames;
mod imu;
pub mod line;
pub mod mip;
pub mod phidget;
mod port;
pub mod protocol;
mod reading;
mod reading_source;
mod sequence;
mod serial;
mod twists;
mod upright;
pub mod xsens;

pub use axes::Axes;
pub use error::Error;
pub use imu::Imu;
pub use reading::{Reading, STANDARD_GRAVITY_M_S2};
pub use reading_source::ReadingSource;
pub use serial::Serial;
