//! What every driver needs: a device's clock in the host's time, pauses between attempts to reach
//! a device, and the state of its link.
//!
//! Pure: time comes in as nanoseconds of the one clock. Not responsible for any protocol, nor for
//! I/O.
//!
//! ```
//! use randt_device::DeviceClock;
//!
//! let mut clock = DeviceClock::default();
//! // A device that began at 0 when the host's clock read 7 s; messages take 1 to 3 ms.
//! for i in 0..1000_i64 {
//!     let device_ns = i * 4_000_000;
//!     let delay_ns = 1_000_000 + (i * 7919) % 2_000_000;
//!     let host_ns = clock.host_ns(device_ns, 7_000_000_000 + device_ns + delay_ns);
//!     let late_ns = host_ns - (7_000_000_000 + device_ns);
//!     assert!(i < 10 || (900_000..1_500_000).contains(&late_ns));
//! }
//! ```

mod backoff;
mod clock;
mod hull;
mod link;

pub use backoff::Backoff;
pub use clock::DeviceClock;
pub use link::{Count, Interruptions, Link};
