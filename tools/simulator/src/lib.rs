//! Worlds and sensors: a simulated drive, as hard as the real thing.
//!
//! Responsible for what a radar and an IMU on a robot would measure, and for the truth behind it.
//! Pure: no files, no clock, no threads; the same seed gives the same bits on every machine. Not
//! responsible for writing logs.

mod caster;
mod echo;
mod error;
mod format;
mod ground;
mod inertial;
mod line;
mod material;
mod motion;
mod radar;
mod random;
mod route;
mod shape;
mod simulation;
mod surface;
mod wheels;
mod world;

pub use caster::{Caster, Hit};
pub use error::WorldError;
pub use ground::{Ground, GroundPoint, Relief, RobotAttitude};
pub use inertial::ImuProfile;
pub use material::{Material, Response};
pub use motion::{Drive, MotionProfile, MotionState};
pub use radar::RadarProfile;
pub use random::Random;
pub use randt_messages::Event;
pub use simulation::{Robot, START_NS, Simulation};
pub use surface::BeamSurface;
pub use wheels::{WheelFault, WheelProfile};
pub use world::{Wall, World};
