//! The journal as a file: opened by one mapper, appended to, cut back, quarantined; never deleted.

mod compaction;
mod count;
mod sync;
mod whole_file;

pub use compaction::{Compacted, Compaction};
pub use sync::{Sync, Synced};

use super::tail::Tail;
use super::{
    Bytes, Contents, Damage, Error, append_keyframe, append_snapshot, begin, is_snapshot_due,
};
use crate::{Known, Mapper};
use count::Count;
use randt_config::Config;
use randt_messages::{Keyframe, MessageRef};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use whole_file::{read_range, write_whole};

/// A journal is compacted when it has this many times the bytes that are needed, ...
const COMPACTION_FACTOR: u64 = 2;
/// ... and as many more: 200 keyframes of a hall, less than a map of one room.
const COMPACTION_MIN: u64 = 4 << 20;
/// Ending of a compacted journal's file until it takes the old one's place.
const COMPACTED: &str = ".compacted.part";

/// A journal that was opened.
#[derive(Debug)]
pub struct Opened {
    /// To append to.
    pub journal: JournalFile,
    /// All that it holds, for [`Mapper::recall`].
    pub contents: Contents,
    /// What was cut off its end.
    pub cut: Option<Damage>,
    /// Where a file that is no journal, or one damaged in the middle, was moved, and why. Of the
    /// latter the part before the damage goes on.
    pub quarantined: Option<(PathBuf, String)>,
}

/// The file that a mapper writes to, alone meanwhile.
///
/// A caller that appends a keyframe before it pushes it never has a map with one that the journal
/// lacks.
#[derive(Debug)]
pub struct JournalFile {
    path: PathBuf,
    tail: Tail<File>,
    count: Count,
    /// What the snapshots have; of those from before it was opened nothing, because they may be of
    /// another form.
    known: Known,
    /// As [`Self::end`], of the newest keyframe that is on the disk.
    on_disk: u64,
    /// Whether its name is not on the disk yet: a compaction has taken the old file's place.
    is_renamed: bool,
    bytes: Vec<u8>,
    /// Held, not used. A file of its own, because the journal is renamed.
    _lock: File,
}

impl JournalFile {
    /// Opens a journal, or begins one. Waits for no other mapper: two never write one journal.
    pub fn open(path: impl Into<PathBuf>, config: &Config) -> Result<Opened, Error> {
        Self::open_by(path, config, |path| Ok(Arc::new(fs::read(path)?)))
    }

    /// The same, with another way to read a file. Its bytes must stay what they are: the file only
    /// grows.
    pub fn open_by(
        path: impl Into<PathBuf>,
        config: &Config,
        read: impl FnOnce(&Path) -> io::Result<Bytes>,
    ) -> Result<Opened, Error> {
        let path = path.into();
        let lock = lock(&named(&path, ".lock"))?;
        // Of a compaction that a kill broke off; the journal has all of it.
        let _ = fs::remove_file(named(&path, COMPACTED));
        let mut beginning = Vec::new();
        begin(config, &mut beginning);
        let bytes = match read(&path) {
            Ok(bytes) => bytes,
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => Arc::new([0_u8; 0]),
            Err(cause) => return Err(io_error(&path, "read", cause)),
        };
        let all = (*bytes).as_ref();
        let (mut quarantined, mut cut) = (None, None);
        let mut contents = Contents::default();
        let mut anew = all.is_empty().then_some(&beginning[..]);
        if !all.is_empty() {
            match Contents::read(&bytes) {
                Ok(found) => {
                    contents = found;
                    cut = contents.damage.clone();
                    if let Some(damage) = cut.take_if(|damage| damage.in_the_middle) {
                        let why = format!("offset {}: {}", damage.offset, damage.what);
                        quarantined = Some((quarantine(&path)?, why));
                        anew = all.get(..contents.good);
                    }
                }
                // Another program's file under a wrong name is not moved.
                Err(cause @ Error::NotAJournal(_)) => {
                    let cause = Box::new(cause);
                    return Err(Error::Foreign { path, cause });
                }
                Err(why) => {
                    quarantined = Some((quarantine(&path)?, why.to_string()));
                    anew = Some(&beginning);
                }
            }
        }
        if let Some(anew) = anew {
            write_whole(&path, anew)?;
            contents.good = anew.len();
        }
        let mut journal = Self {
            tail: tail(&path, contents.good as u64)?,
            path,
            count: Count::from_contents(&contents),
            known: Known::default(),
            on_disk: 0,
            is_renamed: false,
            bytes: Vec::new(),
            _lock: lock,
        };
        journal.sync()?;
        Ok(Opened {
            journal,
            contents,
            cut,
            quarantined,
        })
    }

    /// Appends a keyframe. It is not on the disk before [`Self::sync`].
    pub fn append_keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) -> Result<(), Error> {
        let bytes = self.append(|bytes| append_keyframe(keyframe, bytes))?;
        self.count.keyframes += 1;
        self.count.keyframe_bytes += bytes;
        self.count.end = keyframe.head.id.saturating_add(1);
        Ok(())
    }

    /// Appends a snapshot of the mapper, which has taken no keyframes but the journal's.
    pub fn append_snapshot(&mut self, mapper: &Mapper) -> Result<(), Error> {
        let known = self.known;
        self.append(|bytes| append_snapshot(mapper, known, bytes))?;
        self.count.in_snapshot = mapper.taken() as u64;
        self.known = mapper.known();
        Ok(())
    }

    /// A snapshot that goes with the journal as it is, for somewhere else.
    pub fn checkpoint(&self, mapper: &Mapper) -> Vec<u8> {
        let mut bytes = Vec::new();
        mapper.snapshot(self.known, &mut bytes);
        bytes
    }

    /// The mapper was recalled: snapshots of what it has not taken are none of this program's.
    pub fn recalled(&mut self, mapper: &Mapper) {
        self.count.in_snapshot = self.count.in_snapshot.min(mapper.taken() as u64);
    }

    /// Whether the mapper has taken enough keyframes since the last snapshot that the next restart
    /// would take too long without another.
    pub fn is_snapshot_due(&self, mapper: &Mapper) -> bool {
        is_snapshot_due(self.count.keyframes, self.after_snapshot(mapper))
    }

    /// Whether the mapper has taken keyframes that no snapshot has.
    pub fn has_news(&self, mapper: &Mapper) -> bool {
        self.after_snapshot(mapper) > 0
    }

    fn after_snapshot(&self, mapper: &Mapper) -> u64 {
        (mapper.taken() as u64).saturating_sub(self.count.in_snapshot)
    }

    /// Comes back when everything is on the disk.
    pub fn sync(&mut self) -> Result<(), Error> {
        let sync = self.begin_sync()?;
        self.finish_sync(sync.run())
    }

    /// The same in two steps, with [`Sync::run`] between them; it stands for what was appended
    /// before.
    pub fn begin_sync(&mut self) -> Result<Sync, Error> {
        self.check()?;
        Ok(Sync {
            file: self.file()?,
            renamed: self.is_renamed.then(|| self.path.clone()),
            end: self.count.end,
        })
    }

    /// A sync has ended.
    pub fn finish_sync(&mut self, synced: Synced) -> Result<(), Error> {
        self.tail.is_unsure |= synced.done.is_err();
        let done = synced.done;
        done.map_err(|cause| io_error(&self.path, "bring onto the disk", cause))?;
        self.is_renamed &= !synced.is_renamed;
        self.on_disk = synced.end;
        Ok(())
    }

    /// Whether the journal has several times what the mapper, which has taken all of it, still
    /// needs.
    pub fn is_compaction_due(&self, mapper: &Mapper) -> bool {
        if self.length() < COMPACTION_MIN {
            return false;
        }
        let Count {
            keyframes,
            forgotten,
            keyframe_bytes,
            snapshot_bytes,
            ..
        } = self.count;
        let news = (mapper.forgotten().count() as u64).saturating_sub(forgotten);
        let whole = keyframes.saturating_sub(forgotten).max(1);
        let needed = keyframe_bytes - keyframe_bytes / whole * news.min(whole) + snapshot_bytes;
        news > 0 && self.length() > COMPACTION_MIN + COMPACTION_FACTOR * needed
    }

    /// Begins to write the journal anew without what the mapper no longer needs, which has taken
    /// all of it. Nothing may be synced before [`Self::finish_compaction`].
    pub fn begin_compaction(&self, mapper: &Mapper) -> Result<Compaction, Error> {
        self.check()?;
        let mut snapshot = Vec::new();
        append_snapshot(mapper, Known::default(), &mut snapshot)?;
        Ok(Compaction {
            file: self.file()?,
            until: self.length(),
            new_path: named(&self.path, COMPACTED),
            forgotten: mapper.forgotten().collect(),
            snapshot,
        })
    }

    /// Puts the new file in the old one's place, with what has come meanwhile.
    ///
    /// All that was on the disk is in the part of the new file that is, so that either of them may
    /// be the one that a power cut leaves.
    pub fn finish_compaction(&mut self, compacted: Compacted) -> Result<(), Error> {
        self.check()?;
        let Compacted {
            new_path, until, ..
        } = &compacted;
        let length = self.length();
        let replace = || {
            let since = read_range(&self.tail.storage, *until..length)?;
            let mut file = OpenOptions::new().read(true).append(true).open(new_path)?;
            file.write_all(&since)?;
            fs::rename(new_path, &self.path)?;
            Ok((file, since.len() as u64))
        };
        let (file, since) = replace().map_err(|cause| io_error(&self.path, "replace", cause))?;
        self.tail = Tail::new(file, compacted.length + since);
        self.is_renamed = true;
        self.count.forgotten = compacted.forgotten;
        self.count.keyframe_bytes = compacted.keyframe_bytes + since;
        self.count.snapshot_bytes = compacted.snapshot_bytes;
        Ok(())
    }

    /// The number after the newest keyframe's.
    pub fn end(&self) -> u64 {
        self.count.end
    }

    /// Keyframes below this number are on the disk.
    pub fn on_disk(&self) -> u64 {
        self.on_disk
    }

    /// Moves the journal out of the way, for one that begins anew; gives where it is.
    pub fn quarantine(self) -> Result<PathBuf, Error> {
        let quarantined = quarantine(&self.path)?;
        match fs::remove_file(&self.path) {
            Err(cause) if cause.kind() != io::ErrorKind::NotFound => {
                Err(io_error(&self.path, "quarantine", cause))
            }
            _ => Ok(quarantined),
        }
    }

    /// Bytes of the file.
    pub fn length(&self) -> u64 {
        self.tail.good
    }

    fn append(
        &mut self,
        fill: impl FnOnce(&mut Vec<u8>) -> Result<(), Error>,
    ) -> Result<u64, Error> {
        self.check()?;
        self.bytes.clear();
        fill(&mut self.bytes)?;
        let appended = self.tail.append(&self.bytes);
        appended.map_err(|cause| io_error(&self.path, "append", cause))?;
        Ok(self.bytes.len() as u64)
    }

    /// Its file once more, for another thread.
    fn file(&self) -> Result<File, Error> {
        let file = self.tail.storage.try_clone();
        file.map_err(|cause| io_error(&self.path, "open once more", cause))
    }

    fn check(&self) -> Result<(), Error> {
        match self.tail.is_unsure {
            true => Err(Error::Unsure(self.path.clone())),
            false => Ok(()),
        }
    }
}

/// Opens the end of a file behind its good bytes.
fn tail(path: &Path, good: u64) -> Result<Tail<File>, Error> {
    let file = OpenOptions::new().read(true).append(true).open(path);
    let file = file.map_err(|cause| io_error(path, "open", cause))?;
    let cut = file.set_len(good);
    cut.map_err(|cause| io_error(path, "cut the damaged end off", cause))?;
    Ok(Tail::new(file, good))
}

fn lock(path: &Path) -> Result<File, Error> {
    let mut options = OpenOptions::new();
    let file = options.create(true).append(true).open(path);
    let file = file.map_err(|cause| io_error(path, "create", cause))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::Locked(path.to_owned())),
        Err(TryLockError::Error(cause)) => Err(io_error(path, "lock", cause)),
    }
}

/// Gives a file another name, the first that is free. Where the disk can, it keeps the old one
/// until that is written anew: a kill in between loses nothing.
fn quarantine(path: &Path) -> Result<PathBuf, Error> {
    let names = (1..).map(|n: u64| named(path, &format!(".quarantined-{n}")));
    let mut free = names.filter(|name| !name.exists());
    let quarantined = free.next().unwrap_or_else(|| named(path, ".quarantined"));
    let linked = fs::hard_link(path, &quarantined);
    let renamed = linked.or_else(|_| fs::rename(path, &quarantined));
    renamed.map_err(|cause| io_error(path, "quarantine", cause))?;
    Ok(quarantined)
}

fn named(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

fn io_error(path: &Path, action: &'static str, cause: io::Error) -> Error {
    Error::Io {
        path: path.to_owned(),
        action,
        cause,
    }
}
