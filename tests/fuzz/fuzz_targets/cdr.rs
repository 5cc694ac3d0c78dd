//! ROS messages, CDR and ROS 1.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| randt_readers::fuzzing::messages(bytes));
