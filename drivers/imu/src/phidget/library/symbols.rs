//! The library's symbols, as the vendor's Python package calls them.

use std::ffi::{CStr, c_char, c_int, c_void};

/// `PhidgetHandle` and `PhidgetSpatialHandle`.
pub(super) type Handle = *mut c_void;
/// `PhidgetReturnCode`: 0 is good.
pub(super) type Code = c_int;
pub(super) type OnChange = unsafe extern "C" fn(Handle, *mut c_void);
pub(super) type OnError = unsafe extern "C" fn(Handle, *mut c_void, c_int, *const c_char);
pub(super) type OnData =
    unsafe extern "C" fn(Handle, *mut c_void, *const f64, *const f64, *const f64, f64);

macro_rules! symbols {
    ($( $name:ident = $symbol:literal ( $($argument:ty),* ) ),+ $(,)?) => {
        #[derive(Debug)]
        pub(super) struct Symbols { $( pub(super) $name: unsafe extern "C" fn($($argument),*) -> Code ),+ }

        impl Symbols {
            /// All of a library.
            pub(super) fn load(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the types are those by which the vendor's Python package calls them; the
                // library is never unloaded.
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
    pub(super) fn check(&self, code: Code) -> Result<(), String> {
        if code == 0 {
            return Ok(());
        }
        let mut text = std::ptr::null();
        // SAFETY: the text is a constant of the library.
        let text = unsafe {
            (self.describe)(code, &mut text);
            text_from(text)
        };
        Err(format!("libphidget22: {text} (error {code})"))
    }

    /// Asks for an interval as near as the device has it; gives what it has, and what was wrong.
    ///
    /// # Safety
    /// The handle is an attached channel's.
    pub(super) unsafe fn negotiate_interval(&self, handle: Handle, asked_ms: u32) -> (u32, String) {
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
pub(super) unsafe fn text_from(text: *const c_char) -> String {
    if text.is_null() {
        return "no text".to_owned();
    }
    // SAFETY: as the caller promises.
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}
