//! From a cloud of points to a sweep: polar points, what is the same in every turn, the message.

mod build;
mod learn;
mod polar;
mod repair;
mod sectors;

pub(crate) use build::wrap_f32;
pub(crate) use learn::Turn;
pub(crate) use polar::Polar;
#[cfg(test)]
pub(crate) use polar::PolarPoint;
pub(crate) use repair::{find_first_returns, repair};
pub(crate) use sectors::are_sectors;
