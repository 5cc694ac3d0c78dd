//! ROS 1 bags, format 2.0.

mod bag;
mod chunk;
mod record;
mod walker;

pub(crate) use bag::Bag;
pub(crate) use walker::MAGIC;
