//! Persisted state: what a struct remembers, as bytes and back, to the last bit.
//!
//! Responsible for one list of a struct's fields that serves both ways, and for the envelope that tells damage and
//! foreign states. Not responsible for keeping the bytes: this crate knows no file, no clock.
//!
//! A state is restored into a struct that was made as new. So what follows from the configuration is not saved, and
//! the struct keeps the room it was made with. The bytes are for the machine and the build that made them.
//!
//! ```
//! use randt_persist::{StateIdentity, decode, persist, encode};
//!
//! #[derive(Debug, PartialEq)]
//! struct Mean { count: u64, mean: f64, limit: f64 }
//! persist!(Mean { count, mean } kept { limit });
//!
//! let identity = StateIdentity { magic: *b"EXAMPLE ", code: *b"0123456789abcdef", config: 1 };
//! let before = Mean { count: 3, mean: 0.1 + 0.2, limit: 9.0 };
//! let mut bytes = [0; 100];
//! let length = encode(&identity, &mut bytes, |out| randt_persist::Persist::save(&before, out))?;
//!
//! let mut after = Mean { count: 0, mean: 0.0, limit: 9.0 };
//! let mut from = decode(&identity, &bytes[..length])?;
//! randt_persist::Persist::restore(&mut after, &mut from)?;
//! from.end()?;
//! assert_eq!(after, before);
//! # Ok::<(), randt_persist::Error>(())
//! ```

mod envelope;
mod error;
mod fields;
mod reader;
mod values;
mod writer;

pub use envelope::{StateIdentity, decode, encode};
pub use error::Error;
pub use reader::Reader;
pub use writer::Writer;

/// Can be saved, and restored into one that was made as new.
pub trait Persist {
    /// Writes what has to be remembered.
    fn save(&self, out: &mut Writer<'_>);

    /// Takes over what was saved. After an error it is good for nothing.
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error>;
}
