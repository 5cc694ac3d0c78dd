//! One Spatial of the library, on USB or at a server.

use super::Library;
use super::callbacks::{Event, Shared, attached, detached, failed, measured};
use super::symbols::{Code, Handle, Symbols};
use rustix::event::{EventfdFlags, eventfd};
use std::ffi::{CString, c_int, c_void};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, sync_channel};

/// Events that wait for the driver: eight seconds of samples, as on the bus.
const EVENTS: usize = 2048;

/// A Phidget network server: host and port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::phidget) struct Server {
    name: CString,
    host: CString,
    port: u16,
}

impl Server {
    /// Reads `HOST:PORT`.
    pub(in crate::phidget) fn parse(text: &str) -> Option<Self> {
        let (host, port) = text.rsplit_once(':')?;
        let host = host.trim_start_matches('[').trim_end_matches(']');
        Some(Self {
            name: CString::new(text).ok()?,
            host: CString::new(host).ok().filter(|host| !host.is_empty())?,
            port: port.parse().ok()?,
        })
    }
}

/// A handle that may go to another thread: the library locks what it names.
#[derive(Clone, Copy, Debug)]
struct Sent(Handle);
// SAFETY: the library's functions may be called by any thread.
unsafe impl Send for Sent {}

impl Sent {
    fn handle(self) -> Handle {
        self.0
    }
}

/// One Spatial of the library, open all its life.
#[derive(Debug)]
pub(in crate::phidget) struct Channel {
    symbols: &'static Symbols,
    handle: Handle,
    server: Option<Server>,
    events: Receiver<Event>,
    wake: Arc<OwnedFd>,
    lost: Arc<AtomicU64>,
    busy: Arc<AtomicBool>,
}

impl Channel {
    /// Opens the first Spatial, or that with a serial number, on USB or at a server. It may attach
    /// at any time later.
    pub(in crate::phidget) fn open(
        library: Library,
        serial_number: Option<i32>,
        server: Option<Server>,
        interval_ms: u32,
    ) -> Result<Self, String> {
        let symbols = library.symbols;
        let flags = EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC;
        let wake = eventfd(0, flags).map_err(|error| format!("an event counter: {error}"))?;
        let (sender, events) = sync_channel(EVENTS);
        let (wake, lost) = (Arc::new(wake), Arc::new(AtomicU64::new(0)));
        let shared = Box::new(Shared {
            symbols,
            asked_ms: interval_ms,
            events: sender,
            wake: Arc::clone(&wake),
            lost: Arc::clone(&lost),
        });
        let remote = c_int::from(server.is_some());
        let mut channel = Self {
            symbols,
            handle: null_mut(),
            server,
            events,
            wake,
            lost,
            busy: Arc::default(),
        };
        let check = |code| symbols.check(code);
        // SAFETY: the handle is written by `create` and used for nothing but its own channel; the
        // context is never freed.
        unsafe {
            check((symbols.create)(&mut channel.handle))?;
            let (handle, context) = (channel.handle, std::ptr::from_ref(Box::leak(shared)));
            let context = context.cast_mut().cast::<c_void>();
            check((symbols.on_attach)(handle, attached, context))?;
            check((symbols.on_detach)(handle, detached, context))?;
            check((symbols.on_error)(handle, failed, context))?;
            check((symbols.on_data)(handle, measured, context))?;
            check((symbols.set_is_remote)(handle, remote))?;
            check((symbols.set_is_local)(handle, 1 - remote))?;
            if let Some(serial_number) = serial_number {
                check((symbols.set_serial_number)(handle, serial_number))?;
            }
            if let Some(server) = &channel.server {
                check(add(symbols, server))?;
            }
            check((symbols.open)(handle))?;
        }
        Ok(channel)
    }

    /// Begins anew with what does not send: a server is connected anew, a USB device opened anew.
    /// That may take the library long, so it is done in a thread.
    pub(in crate::phidget) fn renew(&self) {
        if self.busy.swap(true, Relaxed) {
            return;
        }
        let (symbols, server) = (self.symbols, self.server.clone());
        let (sent, busy) = (Sent(self.handle), Arc::clone(&self.busy));
        std::thread::spawn(move || {
            // SAFETY: the handle is not deleted while `busy` is set.
            unsafe {
                match &server {
                    Some(server) => {
                        (symbols.remove_server)(server.name.as_ptr());
                        add(symbols, server);
                    }
                    None => {
                        (symbols.close)(sent.handle());
                        (symbols.open)(sent.handle());
                    }
                }
            }
            busy.store(false, Relaxed);
        });
    }

    /// What to sleep on.
    pub(in crate::phidget) fn descriptor(&self) -> BorrowedFd<'_> {
        self.wake.as_fd()
    }

    /// What the library called back with since.
    pub(in crate::phidget) fn events(&self) -> impl Iterator<Item = Event> {
        let _ = rustix::io::read(&self.wake, &mut [0; 8]);
        self.events.try_iter()
    }

    /// Events that came while too many waited.
    pub(in crate::phidget) fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }
}

impl Drop for Channel {
    fn drop(&mut self) {
        // Where the library still works on it, it keeps it.
        if self.handle.is_null() || self.busy.load(Relaxed) {
            return;
        }
        // SAFETY: it is the channel's own, and goes no further.
        unsafe {
            (self.symbols.close)(self.handle);
            if let Some(server) = &self.server {
                (self.symbols.remove_server)(server.name.as_ptr());
            }
            (self.symbols.delete)(&mut self.handle);
        }
    }
}

/// # Safety
/// The symbols are the library's.
unsafe fn add(symbols: &Symbols, server: &Server) -> Code {
    // SAFETY: texts end with a zero and are copied.
    unsafe {
        let (name, host) = (server.name.as_ptr(), server.host.as_ptr());
        (symbols.add_server)(name, host, c_int::from(server.port), c"".as_ptr(), 0)
    }
}
