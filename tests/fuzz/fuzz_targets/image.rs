//! Polar images.

#![no_main]

mod input;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| input::read(b"\x89PNG\r\n\x1a\n", bytes));
