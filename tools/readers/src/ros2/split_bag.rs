//! Several files of one recording, one after the other.

use crate::ros::{Channel, Raw, Recording};
use crate::{Error, counters::Counters};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The files of a split recording as one.
pub(crate) struct SplitBag {
    files: Vec<Box<dyn Recording>>,
    channels: Vec<Channel>,
    /// For each file, the indices of its channels in `channels`.
    indices: Vec<Vec<usize>>,
    transforms: Vec<Vec<u8>>,
    /// Why files are missing; counted with the first message.
    unreadable: Vec<String>,
    present: usize,
}

impl SplitBag {
    pub fn new(files: Vec<Box<dyn Recording>>, unreadable: Vec<String>) -> Self {
        let mut channels: Vec<Channel> = Vec::new();
        let mut indices = Vec::new();
        let mut transforms = Vec::new();
        for file in &files {
            let file_indices = file.channels().iter().map(|channel| {
                let same =
                    |c: &Channel| c.topic == channel.topic && c.type_name == channel.type_name;
                if let Some(index) = channels.iter().position(same) {
                    if let Some(known) = channels.get_mut(index) {
                        known.messages += channel.messages;
                    }
                    index
                } else {
                    channels.push(channel.clone());
                    channels.len() - 1
                }
            });
            indices.push(file_indices.collect());
            transforms.extend_from_slice(file.static_transforms());
        }
        Self {
            files,
            channels,
            indices,
            transforms,
            unreadable,
            present: 0,
        }
    }
}

impl Recording for SplitBag {
    fn format(&self) -> &'static str {
        self.files.first().map_or("ros2-mcap", |file| file.format())
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn close(&mut self, counters: &mut Counters) {
        self.files.iter_mut().for_each(|file| file.close(counters));
    }

    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        for why in self.unreadable.drain(..) {
            counters.count_loss("bag_parts_unreadable", 1, || why);
        }
        let Self {
            files,
            indices,
            present,
            channels,
            ..
        } = self;
        for (number, file) in files.iter_mut().enumerate().skip(*present) {
            *present = number;
            if let Some(raw) = file.next_message(counters)? {
                let index = indices
                    .get(number)
                    .and_then(|indices| indices.get(raw.channel));
                let channel = index.copied().unwrap_or(channels.len());
                return Ok(Some(Raw { channel, ..raw }));
            }
        }
        Ok(None)
    }
}

/// The files of a bag's folder in the order of recording; rosbag2 numbers them `NAME_0`, `NAME_1`,
/// ...
pub(crate) fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let extension = path.extension().and_then(OsStr::to_str);
        if path.is_file() && matches!(extension, Some("db3" | "mcap")) {
            files.push(path);
        }
    }
    files.sort_by_key(|path| (number(path), path.clone()));
    Ok(files)
}

/// The number at the end of a file's name.
fn number(path: &Path) -> Option<u64> {
    let stem = path.file_stem().and_then(OsStr::to_str)?;
    stem.rsplit('_').next()?.parse().ok()
}
