//! Where the bytes go: one file at a time, only ever appended to.

use std::io;

/// What the recorder needs of a disk. Tests have ones that are full, slow, broken or lose their
/// power.
pub trait Sink {
    /// Begins a file; refuses where the name is taken (`AlreadyExists`). It is not called that
    /// before it is finished.
    fn create(&mut self, name: &str) -> io::Result<()>;
    /// Adds to its end.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Returns when all that was added would outlive a power cut; refuses where the file is not in
    /// its folder any more.
    fn sync(&mut self) -> io::Result<()>;
    /// Syncs it and gives it its name.
    fn finish(&mut self) -> io::Result<()>;
    /// Leaves it as it is: it can be recovered.
    fn abandon(&mut self);
    /// Deletes it: it holds nothing that is not kept elsewhere.
    fn discard(&mut self);
    /// Room that is left on the disk.
    fn free_bytes(&mut self) -> io::Result<u64>;
    /// Deletes the oldest finished log; gives its name, `None` where there is none.
    fn delete_oldest(&mut self) -> io::Result<Option<String>>;
}
