//! What runs in real time and what computes as fast as it can take turns.
//!
//! An emulated sensor that is kept from sending loses data, as a real one does; so nothing
//! computes as long as a drive is lived whose every message counts. Drives of one kind run side by
//! side.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// How many of each kind are under way.
struct UnderWay {
    real_time: usize,
    computing: usize,
}

static UNDER_WAY: Mutex<UnderWay> = Mutex::new(UnderWay {
    real_time: 0,
    computing: 0,
});
static CHANGED: Condvar = Condvar::new();

/// As long as it is held nothing computes. Its holder may not compute either: that would wait
/// without end.
pub struct RealTime(());

/// As long as it is held no drive is lived.
pub struct Computing(());

impl RealTime {
    /// Waits until what computes is done.
    pub fn begin() -> Self {
        let mut now = under_way();
        // At once, so that nothing new begins to compute meanwhile.
        now.real_time += 1;
        while now.computing > 0 {
            now = CHANGED.wait(now).unwrap_or_else(PoisonError::into_inner);
        }
        Self(())
    }
}

impl Computing {
    /// Waits until what is lived is over.
    pub fn begin() -> Self {
        let mut now = under_way();
        while now.real_time > 0 {
            now = CHANGED.wait(now).unwrap_or_else(PoisonError::into_inner);
        }
        now.computing += 1;
        Self(())
    }
}

impl Drop for RealTime {
    fn drop(&mut self) {
        under_way().real_time -= 1;
        CHANGED.notify_all();
    }
}

impl Drop for Computing {
    fn drop(&mut self) {
        under_way().computing -= 1;
        CHANGED.notify_all();
    }
}

fn under_way() -> MutexGuard<'static, UnderWay> {
    // A test that failed meanwhile has changed nothing by halves.
    UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}
