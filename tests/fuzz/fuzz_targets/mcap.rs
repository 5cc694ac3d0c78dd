//! MCAP: ROS 2 bags and our own logs.

#![no_main]

mod input;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| input::read(b"\x89MCAP0\r\n", bytes));
