//! The envelope of a saved state: its identity, its length, and a checksum over everything.

use crate::{Error, Reader, Writer};
use bytemuck::{Pod, Zeroable};

/// Which states can be restored into each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateIdentity {
    /// The kind of state.
    pub magic: [u8; 8],
    /// Fingerprint of the source that gives the bytes their meaning, as text.
    pub code: [u8; 16],
    /// Fingerprint of the configuration in force.
    pub config: u64,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    code: [u8; 16],
    config: u64,
    /// Bytes of the state without the head.
    length: u64,
    /// Over the head with a zero here, and the state.
    crc: u32,
    reserved: u32,
}

const HEAD: usize = size_of::<Head>();

/// Writes a state that `save` writes, with its identity; returns the number of bytes in use. Fails
/// with [`Error::Room`].
pub fn encode(
    identity: &StateIdentity,
    out: &mut [u8],
    save: impl FnOnce(&mut Writer<'_>),
) -> Result<usize, Error> {
    let room = out.len();
    let (head_bytes, body) = out.split_at_mut_checked(HEAD).unwrap_or_default();
    let mut writer = Writer::new(body);
    save(&mut writer);
    let length = writer.written();
    let needed = HEAD + length;
    let Some(state) = body.get(..length).filter(|_| head_bytes.len() == HEAD) else {
        return Err(Error::Room { needed, room });
    };
    let mut head = Head {
        magic: identity.magic,
        code: identity.code,
        config: identity.config,
        length: length as u64,
        crc: 0,
        reserved: 0,
    };
    head.crc = checksum(&head, state);
    head_bytes.copy_from_slice(bytemuck::bytes_of(&head));
    Ok(needed)
}

/// Reads a state of this identity. The error distinguishes a damaged state from a foreign one.
pub fn decode<'a>(identity: &StateIdentity, bytes: &'a [u8]) -> Result<Reader<'a>, Error> {
    let begins = bytes.get(..8).unwrap_or(bytes);
    if begins != identity.magic {
        return Err(Error::Foreign(begins.escape_ascii().to_string()));
    }
    let Some((head, state)) = bytes.split_at_checked(HEAD) else {
        return Err(Error::Length {
            found: bytes.len(),
            expected: HEAD as u64,
        });
    };
    let mut head: Head = bytemuck::pod_read_unaligned(head);
    if head.length != state.len() as u64 {
        return Err(Error::Length {
            found: bytes.len(),
            expected: head.length.saturating_add(HEAD as u64),
        });
    }
    let expected = core::mem::take(&mut head.crc);
    let found = checksum(&head, state);
    if found != expected {
        return Err(Error::Checksum { found, expected });
    }
    if head.code != identity.code {
        return Err(Error::OtherCode {
            saved: head.code.escape_ascii().to_string(),
            own: identity.code.escape_ascii().to_string(),
        });
    }
    if head.config != identity.config {
        return Err(Error::OtherConfig {
            saved: head.config,
            own: identity.config,
        });
    }
    Ok(Reader::new(state))
}

fn checksum(head: &Head, state: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(bytemuck::bytes_of(head));
    hasher.update(state);
    hasher.finalize()
}
