//! Recognises an input by its content.

use crate::log::LogSource;
use crate::merge::InOrder;
use crate::oxford::OxfordFolder;
use crate::ros::{Recording, RosSource};
use crate::{Error, Options, Source, ros1, ros2};
use randt_log::{LogReader, ROBOT_METADATA};
use std::fs::File;
use std::io::Read;
use std::path::Path;

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
        return Ok(Box::new(OxfordFolder::open_image(path, options)?));
    }
    if first.starts_with(mcap::MAGIC) && is_ours(path)? {
        let log = LogSource::open(path, options.radar_required)?;
        return Ok(Box::new(InOrder::new(log)));
    }
    match open_bag(path, &first)? {
        Some(bag) => ros_source(bag, path, options),
        None => Err(not_recognised(path, describe(&first))),
    }
}

/// Opens one file of a ROS bag; `None` where it is none.
fn open_bag(path: &Path, first: &[u8]) -> Result<Option<Box<dyn Recording>>, Error> {
    Ok(if first.starts_with(ros1::MAGIC) {
        Some(Box::new(ros1::Bag::open(path)?))
    } else if first.starts_with(mcap::MAGIC) {
        Some(Box::new(ros2::McapBag::open(path)?))
    } else if first.starts_with(ros2::DATABASE_MAGIC) {
        Some(Box::new(ros2::Database::open(path)?))
    } else {
        None
    })
}

fn ros_source(
    bag: Box<dyn Recording>,
    path: &Path,
    options: &Options,
) -> Result<Box<dyn Source>, Error> {
    let source = RosSource::open(bag, path, options)?;
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
    if let Some(folder) = OxfordFolder::open(path, options)? {
        return Ok(Box::new(folder));
    }
    let (mut files, mut unreadable) = (Vec::new(), Vec::new());
    for file in ros2::bag_files(path)? {
        let first = first_bytes(&file)?;
        match open_bag(&file, &first) {
            Ok(Some(bag)) => files.push(bag),
            Ok(None) => unreadable.push(format!("{}: {}", file.display(), describe(&first))),
            Err(error) => unreadable.push(error.to_string()),
        }
    }
    if files.is_empty() {
        let found = unreadable.into_iter().next();
        let found =
            found.unwrap_or_else(|| "a folder without radar images or bag files".to_owned());
        return Err(not_recognised(path, found));
    }
    ros_source(
        Box::new(ros2::SplitBag::new(files, unreadable)),
        path,
        options,
    )
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
