//! The growing end of a file: what is appended is there whole or not at all, as far as the disk
//! allows.

use std::fs::File;
use std::io::{self, Write};

/// What a journal needs of a file.
pub(super) trait Storage {
    /// Writes behind the last byte; where that fails some of it may be there.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Takes away what is behind the first `length` bytes.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

/// A file opened for appending.
impl Storage for File {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes)
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }
}

/// A storage of which the first `good` bytes are whole records.
#[derive(Debug)]
pub(super) struct Tail<S> {
    pub storage: S,
    /// Bytes that are good.
    pub good: u64,
    /// Whether what is on the disk is no longer known: cutting back or a sync has failed. After a
    /// failed sync the kernel may have forgotten the bytes and would call the next one a success.
    pub is_unsure: bool,
}

impl<S: Storage> Tail<S> {
    /// Of a storage that ends with a whole record.
    pub fn new(storage: S, good: u64) -> Self {
        Self {
            storage,
            good,
            is_unsure: false,
        }
    }

    /// Appends whole records, or nothing.
    pub fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let appended = self.storage.append(bytes);
        match appended {
            Ok(()) => self.good += bytes.len() as u64,
            Err(_) => self.is_unsure = self.storage.cut(self.good).is_err(),
        }
        appended
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk of few bytes.
    struct Small {
        bytes: Vec<u8>,
        room: usize,
        is_broken: bool,
    }

    impl Small {
        fn word(&self) -> io::Result<()> {
            match self.is_broken {
                true => Err(io::ErrorKind::Other.into()),
                false => Ok(()),
            }
        }
    }

    impl Storage for Small {
        fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
            let fits = bytes.len().min(self.room - self.bytes.len());
            self.bytes.extend_from_slice(&bytes[..fits]);
            match fits == bytes.len() {
                true => Ok(()),
                false => Err(io::ErrorKind::StorageFull.into()),
            }
        }

        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.word()?;
            self.bytes.truncate(length as usize);
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_leaves_whole_records_and_goes_on_once_there_is_room() {
        let mut tail = Tail::new(
            Small {
                bytes: b"head".to_vec(),
                room: 10,
                is_broken: false,
            },
            4,
        );
        assert!(tail.append(b"one ").is_ok());
        let full = tail.append(b"two ").unwrap_err();
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        assert_eq!((tail.good, tail.is_unsure), (8, false));
        assert_eq!(tail.storage.bytes, b"headone ");
        tail.storage.room = 20;
        assert!(tail.append(b"two ").is_ok());
        assert_eq!(tail.storage.bytes, b"headone two ");
    }

    #[test]
    fn what_cannot_be_cut_back_is_unsure() {
        let storage = Small {
            bytes: Vec::new(),
            room: 2,
            is_broken: true,
        };
        let mut tail = Tail::new(storage, 0);
        assert!(tail.append(b"1").is_ok() && !tail.is_unsure);
        assert!(tail.append(b"two").is_err() && tail.is_unsure);
    }
}
