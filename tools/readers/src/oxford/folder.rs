//! A folder of polar images as a log.

use super::image::PolarImage;
use super::sweep::build;
use crate::{Counter, Error, Event, Extrinsics, InputInfo, Options, Source, counters::Counters};
use randt_messages::SensorKind;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The images that are left to read, oldest first.
pub(crate) struct OxfordFolder {
    info: InputInfo,
    images: std::vec::IntoIter<PathBuf>,
    power_min: f32,
    sweeps: u64,
    counters: Counters,
}

impl OxfordFolder {
    /// Opens the data set's folder (with `radar/` in it) or the folder of the images; `None` for a
    /// folder without images.
    pub fn open(path: &Path, options: &Options) -> Result<Option<Self>, Error> {
        let inner = path.join("radar");
        let (folder, base) = match inner.is_dir() {
            true => (inner.as_path(), Some(path)),
            false => (path, path.parent()),
        };
        let mut images = images(folder)?;
        if images.is_empty() {
            return Ok(None);
        }
        let mut counters = Counters::default();
        let folders = [Some(path), base].into_iter().flatten();
        let mut lists = folders.map(|folder| folder.join("radar.timestamps"));
        if let Some(list) = lists.find(|list| list.is_file())
            && !options.unlisted_scans
        {
            let text = std::fs::read_to_string(&list).map_err(Error::io(&list))?;
            images = listed(images, folder, &text, &list, &mut counters);
        }
        Ok(Some(Self::new(images, options, counters)))
    }

    /// Opens one image as a log of one sweep.
    pub fn open_image(path: &Path, options: &Options) -> Result<Self, Error> {
        PolarImage::read(path).map_err(|found| Error::NotRecognised {
            path: path.display().to_string(),
            found,
        })?;
        let images = vec![path.to_owned()];
        Ok(Self::new(images, options, Counters::default()))
    }

    fn new(images: Vec<PathBuf>, options: &Options, counters: Counters) -> Self {
        Self {
            info: InputInfo {
                format: "oxford",
                sensor: SensorKind::NavtechCts,
                scans: Some(images.len() as u64),
                extrinsics: Extrinsics::default(),
                configuration: None,
            },
            images: images.into_iter(),
            power_min: options.power_min,
            sweeps: 0,
            counters,
        }
    }
}

/// The images of a folder by their names, which are stamps.
fn images(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut images = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("png") && path.is_file() {
            images.push(path);
        }
    }
    images.sort_by_key(|path| (stamp(path), path.clone()));
    Ok(images)
}

/// The stamp that an image is named after, us.
fn stamp(path: &Path) -> Option<u64> {
    path.file_stem().and_then(OsStr::to_str)?.parse().ok()
}

/// The images that the list of stamps names, in its order.
fn listed(
    images: Vec<PathBuf>,
    folder: &Path,
    text: &str,
    list: &Path,
    counters: &mut Counters,
) -> Vec<PathBuf> {
    let list = list.display();
    let present: BTreeSet<&PathBuf> = images.iter().collect();
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let Some(word) = line.split_whitespace().next() else {
            continue;
        };
        let path = folder.join(format!("{word}.png"));
        if present.contains(&path) {
            found.push(path);
        } else {
            let (line, path) = (number + 1, path.display());
            let first = || format!("{list}: line {line}: no image {path}");
            counters.count_loss("scans_missing", 1, first);
        }
    }
    let (listed, all) = (found.len(), images.len());
    let first = || format!("{list} lists {listed} of {all} images");
    counters.count_event("scans_unlisted", all.saturating_sub(listed) as u64, first);
    found
}

impl Source for OxfordFolder {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        for path in self.images.by_ref() {
            let (counters, shown) = (&mut self.counters, path.display());
            let image = match PolarImage::read(&path) {
                Ok(image) => image,
                Err(why) => {
                    counters.count_loss("images_unreadable", 1, || format!("{shown}: {why}"));
                    continue;
                }
            };
            let (scan, over) = build(&image, self.power_min, self.sweeps);
            self.sweeps += 1;
            let lost = u64::from(scan.head.sweep.beams_lost);
            let first = || format!("{shown}: rows missing or not marked as measured");
            counters.count_loss("beams_lost", lost, first);
            let first =
                || format!("{shown}: the strongest are kept (a higher --power-min leaves fewer)");
            counters.count_loss("returns_over_limit", over as u64, first);
            return Ok(Some(Event::Scan(scan)));
        }
        Ok(None)
    }

    fn counters(&self) -> Vec<Counter> {
        self.counters.list()
    }
}
