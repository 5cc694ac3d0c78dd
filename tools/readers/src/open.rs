//! Recognises an input by its content.

use crate::folders::ImageFolder;
use crate::log::LogSource;
use crate::log_folder::{LogFolder, log_files};
use crate::merge::InOrder;
use crate::ros::compressed::{MAGIC, unpack_file};
use crate::ros::{Merged, Recording, RosSource};
use crate::{Error, Options, Source, ros1, ros2};
use randt_log::{LogReader, ROBOT_METADATA};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// First bytes of a PNG.
const PNG_MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Opens a recording of any known format.
///
/// The file's or folder's name plays no part in it. Reading starts at the beginning; the first
/// sweeps are read at once, to learn from them what the radar's turn is.
pub fn open(path: &Path, options: &Options) -> Result<Box<dyn Source>, Error> {
    if path.is_dir() {
        return open_folder(path, options);
    }
    let first = first_bytes(path)?;
    if first.starts_with(PNG_MAGIC) {
        let image = ImageFolder::open_image(path, options)?;
        return Ok(Box::new(image));
    }
    if first.starts_with(mcap::MAGIC) && is_ours(path)? {
        let log = LogSource::open(path, options.radar_required)?;
        return Ok(Box::new(InOrder::new(log)));
    }
    ros_source(vec![path.to_owned()], path, options)
}

/// Opens one file of a ROS bag.
fn open_bag(path: &Path) -> Result<Box<dyn Recording>, Error> {
    let first = first_bytes(path)?;
    Ok(if first.starts_with(ros1::MAGIC) {
        Box::new(ros1::Bag::open(path)?)
    } else if first.starts_with(mcap::MAGIC) {
        Box::new(ros2::McapBag::open(path)?)
    } else if first.starts_with(ros2::DATABASE_MAGIC) {
        Box::new(ros2::Database::open(path)?)
    } else {
        return Err(not_recognised(path, describe(&first)));
    })
}

/// The files of one recording as a source; those that are compressed are decompressed first.
fn ros_source(
    mut files: Vec<PathBuf>,
    path: &Path,
    options: &Options,
) -> Result<Box<dyn Source>, Error> {
    let mut unpacked = Vec::new();
    for file in &mut files {
        if first_bytes(file)?.starts_with(&MAGIC) {
            let plain = unpack_file(file).map_err(Error::io(file))?;
            *file = plain.to_path_buf();
            unpacked.push(plain);
        }
    }
    let mut recording = Merged::new(files, open_bag)?;
    if recording.is_empty() {
        let found = recording.unreadable().first().cloned();
        let found =
            found.unwrap_or_else(|| "a folder without radar images or bag files".to_owned());
        return Err(not_recognised(path, found));
    }
    recording.add_missing(ros2::missing_files(path));
    let source = RosSource::open(Box::new(recording), unpacked, path, options)?;
    Ok(Box::new(InOrder::new(source)))
}

/// Whether an MCAP file is our own log; also where it has no message, or a viewer's first.
fn is_ours(path: &Path) -> Result<bool, Error> {
    let mut reader = LogReader::open(path)?;
    if reader.metadata(ROBOT_METADATA).is_some() {
        return Ok(true);
    }
    let first = reader.next_entry()?;
    Ok(first.is_none_or(|entry| entry.channel.is_ours()))
}

fn first_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    let mut first = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    file.take(64)
        .read_to_end(&mut first)
        .map_err(Error::io(path))?;
    Ok(first)
}

fn open_folder(path: &Path, options: &Options) -> Result<Box<dyn Source>, Error> {
    if let Some(folder) = ImageFolder::open(path, options)? {
        return Ok(Box::new(InOrder::new(folder)));
    }
    if let Some(logs) = LogFolder::open(log_files(path)?, options.radar_required)? {
        return Ok(Box::new(InOrder::new(logs)));
    }
    ros_source(ros2::bag_files(path)?, path, options)
}

fn not_recognised(path: &Path, found: String) -> Error {
    Error::NotRecognised {
        path: path.display().to_string(),
        found,
    }
}

/// The beginning of a foreign file, for an error's text.
fn describe(first: &[u8]) -> String {
    if first.is_empty() {
        return "a file of 0 bytes".to_owned();
    }
    let start = first.get(..first.len().min(16)).unwrap_or_default();
    format!("begins with {}", start.escape_ascii())
}
