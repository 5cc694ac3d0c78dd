//! ROS 1 bags.

#![no_main]

mod input;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| input::read(b"#ROSBAG V2.0\n", bytes));
