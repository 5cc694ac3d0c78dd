//! ROS 2 bags: MCAP and SQLite (db3), alone or as a folder of several files.

mod database;
mod mcap;
mod split_bag;

pub(crate) use database::{Database, MAGIC as DATABASE_MAGIC};
pub(crate) use mcap::{McapBag, count_damage};
pub(crate) use split_bag::{SplitBag, bag_files};
