//! Oxford Radar RobotCar folders: polar images of a Navtech radar.

mod folder;
mod image;
mod sweep;

pub(crate) use folder::OxfordFolder;
