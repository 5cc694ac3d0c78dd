//! Phidgets Spatial by the vendor's libphidget22, over USB or from a Phidget network server.

mod library;
mod spatial;

pub use spatial::Spatial;
