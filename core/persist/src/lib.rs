//! Persisted state: what a struct remembers, as bytes and back, to the last bit.
//!
//! Responsible for one list of a struct's fields that serves both directions, and for the envelope
//! that distinguishes damaged states from foreign ones. Not responsible for keeping the bytes:
//! this crate knows no file and no clock.
//!
//! A state is restored into a struct that was made as new. So what follows from the configuration
//! is not saved, and the struct keeps the capacity it was made with.
//!
//! # The bytes
//!
//! Values follow each other without padding; numbers are little-endian.
//!
//! | value | bytes |
//! |---|---|
//! | integers, floats | as in memory; `usize` as `u64` |
//! | `bool` | one byte, 0 or 1 |
//! | array, matrix (by columns), tuple | its values in their order |
//! | struct of [`persist!`] | its fields in the order of the list |
//! | `Vec`, `VecDeque` | `u64` length, then its values |
//! | `String` | `u64` length in bytes, then UTF-8 |
//! | `Option` | `bool`, then the value where there is one |
//! | enum of [`persist_enum!`] | `u32` [`variant_code`] of the variant's name, then its fields |
//! | [`Writer::varint`] | LEB128: 1 to 10 bytes |
//!
//! [`encode`] puts an envelope of 48 bytes before them: magic (8), code fingerprint (16),
//! configuration fingerprint (`u64`), length of the state (`u64`), CRC-32 over both with a zero in
//! its place (`u32`), zero (`u32`).
//!
//! ```
//! use randt_persist::{StateIdentity, decode, encode, persist};
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
mod variants;
mod writer;

pub use envelope::{StateIdentity, decode, encode};
pub use error::Error;
pub use reader::Reader;
pub use variants::{are_distinct, variant_code};
pub use writer::{Writer, append};

/// Can be saved, and restored into one that was made as new.
pub trait Persist {
    /// Writes what has to be remembered.
    fn save(&self, out: &mut Writer<'_>);

    /// Takes over what was saved. After an error the value must not be used.
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error>;
}
