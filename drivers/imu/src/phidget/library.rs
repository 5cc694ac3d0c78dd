//! libphidget22, the vendor's library, loaded at run time: the one place here that the compiler cannot check.
//!
//! Responsible for its symbols, for one channel, and for bringing what it calls back with to the driver's thread. Not
//! responsible for what any of it means.
//!
//! Why this is sound:
//! - The signatures are those of the vendor's `phidget22.h`, release 1.26 (BSD-3), and of its Python package, which calls
//!   the same symbols. A library that lacks one of them is refused when it is loaded.
//! - It is never unloaded: it has threads of its own, which may be in its code at any time.
//! - What its threads are given, [`Shared`], is never freed, so that a callback that comes late finds it. It is made once
//!   a channel, and a driver has one channel all its life.
//! - The callbacks copy plain values, and only [`Shared`]'s thread-safe parts are touched. They cannot panic: they
//!   allocate nothing but short texts, index nothing and unwrap nothing.
//! - Handles are made by the library, and go back to the one that made them. Its functions may be called by any thread
//!   (the vendor's manual, "Multi-threading").
#![allow(unsafe_code)]

use rustix::event::{EventfdFlags, eventfd};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

/// Events that wait for the driver: eight seconds of samples, as on the bus.
const EVENTS: usize = 2048;

/// `PhidgetHandle` and `PhidgetSpatialHandle`.
type Handle = *mut c_void;
/// `PhidgetReturnCode`: 0 is good.
type Code = c_int;
type OnChange = unsafe extern "C" fn(Handle, *mut c_void);
type OnError = unsafe extern "C" fn(Handle, *mut c_void, c_int, *const c_char);
type OnData = unsafe extern "C" fn(Handle, *mut c_void, *const f64, *const f64, *const f64, f64);

macro_rules! symbols {
    ($( $name:ident = $symbol:literal ( $($argument:ty),* ) ),+ $(,)?) => {
        #[derive(Debug)]
        struct Symbols { $( $name: unsafe extern "C" fn($($argument),*) -> Code ),+ }

        impl Symbols {
            fn of(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the types are those of the vendor's header; the library is never unloaded.
                unsafe { Ok(Self { $( $name: *library.get($symbol)? ),+ }) }
            }
        }
    };
}

symbols! {
    create = b"PhidgetSpatial_create" (*mut Handle),
    delete = b"PhidgetSpatial_delete" (*mut Handle),
    open = b"Phidget_open" (Handle),
    close = b"Phidget_close" (Handle),
    set_serial_number = b"Phidget_setDeviceSerialNumber" (Handle, i32),
    set_is_remote = b"Phidget_setIsRemote" (Handle, c_int),
    set_is_local = b"Phidget_setIsLocal" (Handle, c_int),
    on_attach = b"Phidget_setOnAttachHandler" (Handle, OnChange, *mut c_void),
    on_detach = b"Phidget_setOnDetachHandler" (Handle, OnChange, *mut c_void),
    on_error = b"Phidget_setOnErrorHandler" (Handle, OnError, *mut c_void),
    on_data = b"PhidgetSpatial_setOnSpatialDataHandler" (Handle, OnData, *mut c_void),
    set_interval = b"PhidgetSpatial_setDataInterval" (Handle, u32),
    interval = b"PhidgetSpatial_getDataInterval" (Handle, *mut u32),
    interval_min = b"PhidgetSpatial_getMinDataInterval" (Handle, *mut u32),
    interval_max = b"PhidgetSpatial_getMaxDataInterval" (Handle, *mut u32),
    describe = b"Phidget_getErrorDescription" (Code, *mut *const c_char),
    add_server = b"PhidgetNet_addServer" (*const c_char, *const c_char, c_int, *const c_char, c_int),
    remove_server = b"PhidgetNet_removeServer" (*const c_char),
}

impl Symbols {
    /// What a return code means.
    fn check(&self, code: Code) -> Result<(), String> {
        if code == 0 {
            return Ok(());
        }
        let mut text = std::ptr::null();
        // SAFETY: the text is a constant of the library.
        let text = unsafe {
            (self.describe)(code, &mut text);
            words(text)
        };
        Err(format!("libphidget22: {text} (error {code})"))
    }

    /// Asks for an interval as near as the device has it; gives what it has, and what was wrong.
    ///
    /// # Safety
    /// The handle is an attached channel's.
    unsafe fn settle_interval(&self, handle: Handle, asked_ms: u32) -> (u32, String) {
        let (mut least_ms, mut most_ms, mut is_ms) = (0, u32::MAX, 0);
        // SAFETY: numbers are written to where they are expected.
        unsafe {
            (self.interval_min)(handle, &mut least_ms);
            (self.interval_max)(handle, &mut most_ms);
            let near_ms = asked_ms.max(least_ms).min(most_ms);
            let set = self.check((self.set_interval)(handle, near_ms));
            (self.interval)(handle, &mut is_ms);
            let complaint = match set {
                Err(why) => format!("{asked_ms} ms between samples are refused: {why}"),
                Ok(()) if is_ms != asked_ms => format!(
                    "the device gives a sample every {is_ms} ms instead of {asked_ms}; it takes {least_ms} to {most_ms} ms"
                ),
                Ok(()) => String::new(),
            };
            (is_ms, complaint)
        }
    }
}

/// A text of the library.
///
/// # Safety
/// Null, or ends with a zero.
unsafe fn words(text: *const c_char) -> String {
    if text.is_null() {
        return "no text".to_owned();
    }
    // SAFETY: as the caller promises.
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

/// What the library called back with.
#[derive(Clone, Debug)]
pub(super) enum Event {
    /// The device is there; it was asked for its interval, and this is what it has, ms, and what was wrong.
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
    /// It has something to say.
    Error(String),
}

/// What its threads are given.
#[derive(Debug)]
struct Shared {
    symbols: &'static Symbols,
    asked_ms: u32,
    events: SyncSender<Event>,
    wake: Arc<OwnedFd>,
    lost: Arc<AtomicU64>,
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

unsafe extern "C" fn attached(handle: Handle, context: *mut c_void) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; the handle is the channel's, attached.
    let Some(shared) = (unsafe { context.cast::<Shared>().as_ref() }) else {
        return;
    };
    // SAFETY: as above.
    let (interval_ms, complaint) =
        unsafe { shared.symbols.settle_interval(handle, shared.asked_ms) };
    shared.send(Event::Attach {
        interval_ms,
        complaint,
    });
}

unsafe extern "C" fn detached(_handle: Handle, context: *mut c_void) {
    // SAFETY: the context is a channel's `Shared`, which is never freed.
    if let Some(shared) = unsafe { context.cast::<Shared>().as_ref() } {
        shared.send(Event::Detach);
    }
}

unsafe extern "C" fn failed(_: Handle, context: *mut c_void, code: c_int, text: *const c_char) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; the text ends with a zero.
    if let Some(shared) = unsafe { context.cast::<Shared>().as_ref() } {
        let text = unsafe { words(text) };
        shared.send(Event::Error(format!("{text} (event {code})")));
    }
}

unsafe extern "C" fn measured(
    _handle: Handle,
    context: *mut c_void,
    acceleration_g: *const f64,
    rate_deg_s: *const f64,
    _field_gauss: *const f64,
    timestamp_ms: f64,
) {
    // SAFETY: the context is a channel's `Shared`, which is never freed; vectors are three numbers long.
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

/// A Phidget network server: host and port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Server {
    name: CString,
    host: CString,
    port: u16,
}

impl Server {
    /// Of `HOST:PORT`.
    pub(super) fn of(text: &str) -> Option<Self> {
        let (host, port) = text.rsplit_once(':')?;
        let host = host.trim_start_matches('[').trim_end_matches(']');
        Some(Self {
            name: CString::new(text).ok()?,
            host: CString::new(host).ok().filter(|host| !host.is_empty())?,
            port: port.parse().ok()?,
        })
    }
}

/// The library, loaded for ever.
#[derive(Clone, Copy, Debug)]
pub(super) struct Library {
    symbols: &'static Symbols,
}

impl Library {
    /// Loads it by its path, or by its name as the system searches.
    pub(super) fn load(path: &str) -> Result<Self, libloading::Error> {
        // SAFETY: the vendor's library initialises itself when it is loaded, and nothing else is done by that.
        let library = unsafe { libloading::Library::new(path) }?;
        let symbols = Symbols::of(&library)?;
        // Its threads may be in its code at any time.
        std::mem::forget(library);
        Ok(Self {
            symbols: Box::leak(Box::new(symbols)),
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
pub(super) struct Channel {
    symbols: &'static Symbols,
    handle: Handle,
    server: Option<Server>,
    events: Receiver<Event>,
    wake: Arc<OwnedFd>,
    lost: Arc<AtomicU64>,
    busy: Arc<AtomicBool>,
}

impl Channel {
    /// Opens the first Spatial, or that with a serial number, on USB or at a server. It may attach at any time later.
    pub(super) fn open(
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
        // SAFETY: the handle is written by `create` and used for nothing but its own channel; the context lives for ever.
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

    /// Begins anew with what does not send: a server is connected anew, a USB device opened anew. The library may take
    /// its time for that, so it is done beside.
    pub(super) fn renew(&self) {
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
    pub(super) fn descriptor(&self) -> BorrowedFd<'_> {
        self.wake.as_fd()
    }

    /// What the library called back with since.
    pub(super) fn events(&self) -> impl Iterator<Item = Event> {
        let _ = rustix::io::read(&self.wake, &mut [0; 8]);
        self.events.try_iter()
    }

    /// Events that came while too many waited.
    pub(super) fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
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
