//! ROS 2 bags: MCAP and SQLite (db3), alone or as a folder of several files.

mod bag_files;
mod database;
mod mcap;

pub(crate) use bag_files::{bag_files, missing_files};
pub(crate) use database::{Database, MAGIC as DATABASE_MAGIC};
pub(crate) use mcap::{McapBag, count_damage};
