//! MicroStrain MIP: a serial protocol of packets of fields.
//!
//! Source: the data communications protocol of the 3DM-CV7 and of its elder sisters, and the
//! vendor's MIP SDK (LORD-MicroStrain/mip_sdk, MIT).

mod field;
mod packet;
mod protocol;
mod setup;

pub use field::{Field, GpsTime, SENSOR_DATA};
pub use packet::{Fields, MipFraming, Packet, checksum};
pub use protocol::Mip;
pub use setup::{MipCodec, Step, command};
