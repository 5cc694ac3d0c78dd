//! Several files of one recording, one after the other.

use crate::ros::{Channel, Raw, Recording};
use crate::{Error, tally::Tally};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The parts of a split recording as one.
pub(crate) struct Chain {
    parts: Vec<Box<dyn Recording>>,
    channels: Vec<Channel>,
    /// For each part, the places of its channels in `channels`.
    places: Vec<Vec<usize>>,
    transforms: Vec<Vec<u8>>,
    /// Why parts are missing; counted with the first message.
    unreadable: Vec<String>,
    present: usize,
}

impl Chain {
    pub fn new(parts: Vec<Box<dyn Recording>>, unreadable: Vec<String>) -> Self {
        let mut channels: Vec<Channel> = Vec::new();
        let mut places = Vec::new();
        let mut transforms = Vec::new();
        for part in &parts {
            let of_part = part.channels().iter().map(|channel| {
                let same =
                    |c: &Channel| c.topic == channel.topic && c.type_name == channel.type_name;
                if let Some(place) = channels.iter().position(same) {
                    if let Some(known) = channels.get_mut(place) {
                        known.messages += channel.messages;
                    }
                    place
                } else {
                    channels.push(channel.clone());
                    channels.len() - 1
                }
            });
            places.push(of_part.collect());
            transforms.extend_from_slice(part.static_transforms());
        }
        Self {
            parts,
            channels,
            places,
            transforms,
            unreadable,
            present: 0,
        }
    }
}

impl Recording for Chain {
    fn format(&self) -> &'static str {
        self.parts.first().map_or("ros2-mcap", |part| part.format())
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn close(&mut self, tally: &mut Tally) {
        self.parts.iter_mut().for_each(|part| part.close(tally));
    }

    fn next_message(&mut self, tally: &mut Tally) -> Result<Option<Raw<'_>>, Error> {
        for why in self.unreadable.drain(..) {
            tally.lost("bag_parts_unreadable", 1, || why);
        }
        let Self {
            parts,
            places,
            present,
            channels,
            ..
        } = self;
        for (index, part) in parts.iter_mut().enumerate().skip(*present) {
            *present = index;
            if let Some(raw) = part.next_message(tally)? {
                let place = places.get(index).and_then(|places| places.get(raw.channel));
                let channel = place.copied().unwrap_or(channels.len());
                return Ok(Some(Raw { channel, ..raw }));
            }
        }
        Ok(None)
    }
}

/// The files of a bag's folder in the order of recording; rosbag2 numbers them `NAME_0`, `NAME_1`, ...
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
