//! A folder of polar images as a log, with its IMU where it has one.

use super::imu_file;
use super::imu_mounting::imu_mounting;
use super::layout::{DataSet, Layout, stamp_ns};
use crate::options::{Options, StampMeaning};
use crate::polar_image::{PolarImage, RangeBins, build};
use crate::{
    BinSize, Counter, Error, Event, Extrinsics, InputInfo, InputTopic, Source, counters::Counters,
};
use randt_messages::{ImuSample, SensorKind};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A Navtech's turn, s, where there is one image only.
const PERIOD_NS: i64 = 250_000_000;

/// The images and samples that are left to read, oldest first.
pub(crate) struct ImageFolder {
    info: InputInfo,
    images: std::vec::IntoIter<(PathBuf, Option<i64>)>,
    samples: std::vec::IntoIter<ImuSample>,
    bin_m: f64,
    power_min: f32,
    /// Of images whose rows say nothing of their times.
    stamp: StampMeaning,
    period_ns: i64,
    sweeps: u64,
    counters: Counters,
}

impl ImageFolder {
    /// Opens a data set's folder, or the folder of the images; `None` for a folder without images.
    pub fn open(path: &Path, options: &Options) -> Result<Option<Self>, Error> {
        let layout = Layout::find(path);
        let mut images = images(&layout.images)?;
        if images.is_empty() {
            return Ok(None);
        }
        let mut counters = Counters::default();
        let lists = match layout.data_set {
            DataSet::Radiate => vec![layout.images.with_extension("txt")],
            _ => [path, &layout.base]
                .map(|f| f.join("radar.timestamps"))
                .to_vec(),
        };
        if let Some(list) = lists.into_iter().find(|list| list.is_file())
            && (!options.unlisted_scans || layout.data_set == DataSet::Radiate)
        {
            let text = std::fs::read_to_string(&list).map_err(Error::io(&list))?;
            images = match layout.data_set {
                DataSet::Radiate => numbered(&text, &layout.images),
                _ => listed(images, &layout.images, &text, &list, &mut counters),
            };
        }
        let samples = match &layout.imu {
            Some(path) => {
                imu_file::read(path, layout.data_set, &mut counters).unwrap_or_else(|error| {
                    let text = || format!("{}: {error}", path.display());
                    counters.count_loss("imu_file_unreadable", 1, text);
                    Vec::new()
                })
            }
            None => Vec::new(),
        };
        Ok(Some(Self::new(&layout, images, samples, options, counters)))
    }

    /// Opens one image as a log of one sweep.
    pub fn open_image(path: &Path, options: &Options) -> Result<Self, Error> {
        PolarImage::read(path).map_err(|found| Error::NotRecognised {
            path: path.display().to_string(),
            found,
        })?;
        let layout = Layout::find(path.parent().unwrap_or(path));
        let images = vec![(path.to_owned(), stamp_of(path))];
        let counters = Counters::default();
        Ok(Self::new(&layout, images, Vec::new(), options, counters))
    }

    fn new(
        layout: &Layout,
        images: Vec<(PathBuf, Option<i64>)>,
        samples: Vec<ImuSample>,
        options: &Options,
        counters: Counters,
    ) -> Self {
        // Foreign images may stand before the first one.
        let readable = images.iter().take(8);
        let first = readable
            .clone()
            .find_map(|(path, _)| PolarImage::read(path).ok());
        let stamp_ns = images.iter().find_map(|(_, stamp_ns)| *stamp_ns);
        let bin_size = first.map(|image| BinSize {
            bins: image.bins(),
            size_m: (options.bin_size_m)
                .or_else(|| layout.bin_m(image.bins(), stamp_ns.unwrap_or_default())),
        });
        let mut spacings: Vec<i64> = images
            .windows(2)
            .filter_map(|pair| match pair {
                [(_, Some(a)), (_, Some(b))] => Some(b - a).filter(|ns| *ns > 0),
                _ => None,
            })
            .collect();
        spacings.sort_unstable();
        let given = options.period_s.map(|period_s| (period_s * 1e9) as i64);
        let measured = spacings.get(spacings.len() / 2).copied();
        let topic = |path: &Path, type_name: &str, messages: usize, used_as| InputTopic {
            name: path.display().to_string(),
            type_name: type_name.to_owned(),
            messages: messages as u64,
            used_as: Some(used_as),
        };
        let mut topics = vec![topic(&layout.images, "polar images", images.len(), "radar")];
        if let Some(path) = &layout.imu {
            topics.push(topic(path, "IMU samples", samples.len(), "imu"));
        }
        Self {
            info: InputInfo {
                topics,
                format: layout.format(),
                sensor: SensorKind::NavtechCts,
                scans: Some(images.len() as u64),
                extrinsics: Extrinsics {
                    radar: None,
                    imu: imu_mounting(layout, &samples),
                },
                configuration: None,
                bin_size,
                without_intensity: None,
            },
            images: images.into_iter(),
            samples: samples.into_iter(),
            bin_m: bin_size.and_then(|bins| bins.size_m).unwrap_or_default(),
            power_min: options.power_min,
            stamp: options.stamp,
            period_ns: given.or(measured).unwrap_or(PERIOD_NS),
            sweeps: 0,
            counters,
        }
    }

    /// The next image that can be read, as a sweep.
    fn next_sweep(&mut self) -> Result<Option<Event>, Error> {
        for (path, stamp_ns) in self.images.by_ref() {
            let (counters, shown) = (&mut self.counters, path.display());
            let mut image = match PolarImage::read(&path) {
                Ok(image) => image,
                Err(why) => {
                    counters.count_loss("images_unreadable", 1, || format!("{shown}: {why}"));
                    continue;
                }
            };
            if !image.has_times() {
                let Some(stamp_ns) = stamp_ns else {
                    let first = || format!("{shown}: neither its rows nor its name have a time");
                    counters.count_loss("images_unreadable", 1, first);
                    continue;
                };
                let (begin_ns, end_ns) = self.stamp.interval(stamp_ns, self.period_ns);
                image.set_interval(begin_ns, end_ns);
            }
            if self.bin_m <= 0.0 {
                return Err(Error::BinSize {
                    path: shown.to_string(),
                    bins: image.bins(),
                });
            }
            let bins = RangeBins {
                size_m: self.bin_m,
                offset_m: 0.0,
            };
            let (scan, over) = build(&image, bins, self.power_min, self.sweeps);
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
}

/// The images of a folder by their names, which are stamps.
fn images(folder: &Path) -> Result<Vec<(PathBuf, Option<i64>)>, Error> {
    let mut images = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("png") && path.is_file() {
            let number = path.file_stem().and_then(OsStr::to_str);
            let number: Option<u64> = number.and_then(|name| name.parse().ok());
            images.push((number, path));
        }
    }
    images.sort();
    let images = images.into_iter().map(|(_, path)| {
        let stamp_ns = stamp_of(&path);
        (path, stamp_ns)
    });
    Ok(images.collect())
}

/// The stamp that an image is named after, ns.
fn stamp_of(path: &Path) -> Option<i64> {
    path.file_stem().and_then(OsStr::to_str).and_then(stamp_ns)
}

/// The images that a list of numbers names, with their stamps.
fn numbered(text: &str, folder: &Path) -> Vec<(PathBuf, Option<i64>)> {
    let frames = imu_file::frames(text);
    let image =
        |(name, stamp_ns): (&str, i64)| (folder.join(format!("{name}.png")), Some(stamp_ns));
    frames.map(image).collect()
}

/// The images that the list of stamps names, in its order.
fn listed(
    images: Vec<(PathBuf, Option<i64>)>,
    folder: &Path,
    text: &str,
    list: &Path,
    counters: &mut Counters,
) -> Vec<(PathBuf, Option<i64>)> {
    let list = list.display();
    let present: BTreeSet<&PathBuf> = images.iter().map(|(path, _)| path).collect();
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let Some(word) = line.split_whitespace().next() else {
            continue;
        };
        let path = folder.join(format!("{word}.png"));
        if present.contains(&path) {
            let stamp_ns = stamp_of(&path);
            found.push((path, stamp_ns));
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

impl Source for ImageFolder {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn set_bin_size(&mut self, size_m: f64) {
        self.bin_m = size_m;
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        // Both streams are merged by their stamps: see crate::merge.
        let next = self.samples.as_slice().first();
        let due_ns = self
            .images
            .as_slice()
            .first()
            .and_then(|(_, stamp_ns)| *stamp_ns);
        if next.is_some_and(|next| due_ns.is_none_or(|due_ns| next.header.stamp_ns <= due_ns))
            && let Some(sample) = self.samples.next()
        {
            return Ok(Some(Event::Imu(sample)));
        }
        match self.next_sweep()? {
            None => Ok(self.samples.next().map(Event::Imu)),
            sweep => Ok(sweep),
        }
    }

    fn counters(&self) -> Vec<Counter> {
        self.counters.list()
    }
}
