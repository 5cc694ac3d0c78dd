//! What the library calls, on threads of its own: copies plain values and wakes the driver.

use super::symbols::{Handle, Symbols, text_from};
use std::ffi::{c_char, c_int, c_void};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::SyncSender;
use std::time::Instant;

/// What the library called back with.
#[derive(Clone, Debug)]
pub(in crate::phidget) enum Event {
    /// The device is there; it was asked for its interval, and this is what it has, ms, and what
    /// was wrong.
    Attach { interval_ms: u32, complaint: String },
    /// It is gone.
    Detach,
    /// A measurement in the library's units: g, deg/s, ms since it was attached.
    Data {
        at: Instant,
        acceleration_g: [f64; 3],
        rate_deg_s: [f64; 3],
        timestamp_ms: f64,
    },
    /// An error or a warning of the library.
    Error(String),
}

/// What its threads are given.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) symbols: &'static Symbols,
    pub(super) asked_ms: u32,
    pub(super) events: SyncSender<Event>,
    pub(super) wake: Arc<OwnedFd>,
    pub(super) lost: Arc<AtomicU64>,
}

impl Shared {
    fn send(&self, event: Event) {
        if self.events.try_send(event).is_err() {
            self.lost.fetch_add(1, Relaxed);
        }
        // A counter that is full wakes all the same.
        let _ = rustix::io::write(&self.wake, &1_u64.to_ne_bytes());
    }
}

pub(super) unsafe extern "C" fn attached(handle: Handle, context: *mut c_void) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; the handle is the
    // channel's, attached.
    let Some(shared) = (unsafe { context.cast::<Shared>().as_ref() }) else {
        return;
    };
    // SAFETY: as above.
    let (interval_ms, complaint) =
        unsafe { shared.symbols.negotiate_interval(handle, shared.asked_ms) };
    shared.send(Event::Attach {
        interval_ms,
        complaint,
    });
}

pub(super) unsafe extern "C" fn detached(_handle: Handle, context: *mut c_void) {
    // SAFETY: the context is a channel's `Shared`, which is never freed.
    if let Some(shared) = unsafe { context.cast::<Shared>().as_ref() } {
        shared.send(Event::Detach);
    }
}

pub(super) unsafe extern "C" fn failed(
    _: Handle,
    context: *mut c_void,
    code: c_int,
    text: *const c_char,
) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; the text ends with a
    // zero.
    if let Some(shared) = unsafe { context.cast::<Shared>().as_ref() } {
        let text = unsafe { text_from(text) };
        shared.send(Event::Error(format!("{text} (event {code})")));
    }
}

pub(super) unsafe extern "C" fn measured(
    _handle: Handle,
    context: *mut c_void,
    acceleration_g: *const f64,
    rate_deg_s: *const f64,
    _field_gauss: *const f64,
    timestamp_ms: f64,
) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; vectors are three numbers
    // long.
    let (shared, acceleration_g, rate_deg_s) = unsafe {
        (
            context.cast::<Shared>().as_ref(),
            acceleration_g.cast::<[f64; 3]>().as_ref(),
            rate_deg_s.cast::<[f64; 3]>().as_ref(),
        )
    };
    if let (Some(shared), Some(acceleration_g), Some(rate_deg_s)) =
        (shared, acceleration_g, rate_deg_s)
    {
        shared.send(Event::Data {
            at: Instant::now(),
            acceleration_g: *acceleration_g,
            rate_deg_s: *rate_deg_s,
            timestamp_ms,
        });
    }
}
