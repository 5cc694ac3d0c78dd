//! libphidget22, the vendor's library, loaded at run time: the one place here that the compiler
//! cannot check.
//!
//! Responsible for its symbols, for one channel, and for bringing what it calls back with to the
//! driver's thread. Not responsible for what any of it means.
//!
//! Why this is sound:
//! - The signatures are those by which the vendor's own Python package, release 1.26, calls the
//!   same symbols. A library that lacks one of them is refused when it is loaded.
//! - It is never unloaded: it has threads of its own, which may be in its code at any time.
//! - What its threads are given, `callbacks::Shared`, is never freed, so that a callback that
//!   comes late finds it. It is made once a channel, and a driver has one channel all its life.
//! - The callbacks copy plain values, and only thread-safe parts of `Shared` are touched. They
//!   cannot panic: they allocate nothing but short texts, index nothing and unwrap nothing.
//! - Handles are made by the library, and go back to the one that made them. Its functions may be
//!   called by any thread, as that package does.
#![allow(unsafe_code)]

mod callbacks;
mod channel;
mod symbols;

pub(super) use callbacks::Event;
pub(super) use channel::{Channel, Server};

use symbols::Symbols;

/// The library, which is never unloaded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Library {
    symbols: &'static Symbols,
}

impl Library {
    /// Loads it by its path, or by its name as the system searches.
    pub(super) fn load(path: &str) -> Result<Self, libloading::Error> {
        // SAFETY: the vendor's library initialises itself when it is loaded, and nothing else is
        // done by that.
        let library = unsafe { libloading::Library::new(path) }?;
        let symbols = Symbols::load(&library);
        // Its threads may be in its code at any time.
        std::mem::forget(library);
        Ok(Self {
            symbols: Box::leak(Box::new(symbols?)),
        })
    }
}
