//! `librandt_bus`: the live bus for C, and for every language that calls C.
//!
//! Responsible for opening topics by name and for handing out messages where they lie in shared
//! memory. Not responsible for what is in them: `randt layout --c` prints their structs, and the
//! declarations of these functions behind them.

mod error;
mod reader;

use error::Error;
use randt_stage::{Domain, Observer};
pub use reader::Message;
use reader::Reader;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int};
use std::path::Path;
use std::ptr::null_mut;
use std::rc::Rc;
use std::time::Duration;

thread_local! {
    /// What [`randt_bus_error`] gives.
    static ERROR: RefCell<CString> = RefCell::default();
}

/// A pipeline that is watched: `struct randt_bus`.
pub struct Bus {
    domain: Domain,
    observer: Rc<Observer>,
}

/// One topic: `struct randt_reader`.
pub struct TopicReader(Box<dyn Reader>);

/// Keeps an error for [`randt_bus_error`], and gives what a function returns then.
fn failed<R>(error: &Error, returned: R) -> R {
    // Texts have no byte 0 inside; one that had would be shown as nothing.
    let text = CString::new(error.to_string()).unwrap_or_default();
    ERROR.set(text);
    returned
}

/// A text of the caller; `None` where there is none.
///
/// # Safety
///
/// `text` is null, or points to a text that ends with a byte 0 and lives for `'a`.
#[allow(unsafe_code)]
unsafe fn text_at<'a>(text: *const c_char, what: &'static str) -> Result<Option<&'a str>, Error> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and the caller promises the rest.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| Error::Argument(what))
}

/// Opens the bus of a pipeline. `prefix` and `run` as the programs' options; null for what they
/// take without them. Null where no stage lives, and for every other error.
///
/// # Safety
///
/// Both are null, or texts that end with a byte 0.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_bus_open(prefix: *const c_char, run: *const c_char) -> *mut Bus {
    // SAFETY: what the caller promises.
    let texts = unsafe { (text_at(prefix, "prefix"), text_at(run, "run")) };
    let open = || {
        let domain = Domain::new(texts.0?.unwrap_or("randt"), texts.1?.map(Path::new))?;
        // Another user may have put links there.
        domain.check_owner()?;
        let observer = Observer::enter(&domain)?
            .ok_or_else(|| Error::NoPipeline(domain.folder().display().to_string()))?;
        let observer = Rc::new(observer);
        Ok(Box::into_raw(Box::new(Bus { domain, observer })))
    };
    open().unwrap_or_else(|error: Error| failed(&error, null_mut()))
}

/// Opens a topic that a stage has opened: the header's `RANDT_..._TOPIC` and `RANDT_..._TYPE`.
/// Null where no stage has, or the header is another build's.
///
/// # Safety
///
/// `bus` is null or a bus that is not closed; the others are null or texts that end with a byte 0.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_bus_subscribe(
    bus: *mut Bus,
    topic: *const c_char,
    type_name: *const c_char,
) -> *mut TopicReader {
    // SAFETY: what the caller promises.
    let (bus, texts) = unsafe {
        let texts = (text_at(topic, "topic"), text_at(type_name, "type"));
        (bus.as_ref(), texts)
    };
    let open = || {
        let bus = bus.ok_or(Error::Argument("bus"))?;
        let topic = texts.0?.ok_or(Error::Argument("topic"))?;
        let type_name = texts.1?.ok_or(Error::Argument("type"))?;
        let reader = reader::open(&bus.domain, &bus.observer, topic, type_name)?;
        Ok(Box::into_raw(Box::new(TopicReader(reader))))
    };
    open().unwrap_or_else(|error: Error| failed(&error, null_mut()))
}

/// The next message: 1, and it lies where `message` says until the next call with this reader; 0
/// where none has come in `timeout_ms` (0: it does not wait); -1 for an error.
///
/// # Safety
///
/// `reader` is null or a reader that is not closed, `message` null or a place for a message.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_reader_receive(
    reader: *mut TopicReader,
    timeout_ms: u32,
    message: *mut Message,
) -> c_int {
    // SAFETY: what the caller promises.
    let arguments = unsafe { reader.as_mut().zip(message.as_mut()) };
    let Some((reader, message)) = arguments else {
        return failed(&Error::Argument("reader or message"), -1);
    };
    match reader.0.receive(Duration::from_millis(timeout_ms.into())) {
        Ok(received) => {
            let has_come = received.is_some();
            *message = received.unwrap_or(Message::NONE);
            has_come.into()
        }
        Err(error) => failed(&error, -1),
    }
}

/// Messages that this reader has missed so far.
///
/// # Safety
///
/// `reader` is null or a reader that is not closed.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_reader_missed(reader: *const TopicReader) -> u64 {
    // SAFETY: what the caller promises.
    unsafe { reader.as_ref() }.map_or(0, |reader| reader.0.missed())
}

/// Closes a topic. The last message is gone with it.
///
/// # Safety
///
/// `reader` is null or a reader that is not closed.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_reader_close(reader: *mut TopicReader) {
    if !reader.is_null() {
        // SAFETY: `randt_bus_subscribe` made it, and the caller promises that it is not closed.
        drop(unsafe { Box::from_raw(reader) });
    }
}

/// Closes the bus; readers may outlive it.
///
/// # Safety
///
/// `bus` is null or a bus that is not closed.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn randt_bus_close(bus: *mut Bus) {
    if !bus.is_null() {
        // SAFETY: `randt_bus_open` made it, and the caller promises that it is not closed.
        drop(unsafe { Box::from_raw(bus) });
    }
}

/// Why the last function of this thread failed; there until the next one fails.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn randt_bus_error() -> *const c_char {
    ERROR.with_borrow(|text| text.as_ptr())
}
