//! Phidgets Spatial by libphidget22.
use crate::{Reading, Source};
use randt_config::ImuDriver;
use randt_device::Count;
use std::os::fd::BorrowedFd;

/// A Spatial.
#[derive(Debug)]
pub struct Spatial;
impl Spatial {
    /// By its configuration.
    pub fn new(_config: &ImuDriver) -> Self {
        Self
    }
}
impl Source for Spatial {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> { None }
    fn poll(&mut self, _now_ns: i64, _readings: &mut Vec<Reading>) {}
    fn due_ns(&self) -> Option<i64> { None }
    fn trouble(&self) -> &str { "" }
    fn silence(&self) -> String { String::new() }
    fn complaint(&self) -> &str { "" }
    fn interval_ns(&self) -> i64 { 4_000_000 }
    fn reconnects(&self) -> u64 { 0 }
    fn counts(&self) -> Vec<Count> { Vec::new() }
}
