//! Writes polar images while the radar turns. Does I/O, in a thread of its own.

use crate::dense::{DenseRows, PolarImage};
use crate::{Error, RawBeam, Sweep};
use randt_device::Count;
use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Images that wait for a slow disk: a second's.
const WAITING: usize = 4;

/// What the thread has done.
#[derive(Debug, Default)]
struct Done {
    written: AtomicU64,
    failed: AtomicU64,
}

/// Writes every sweep with all its bins.
#[derive(Debug)]
pub(crate) struct ImageWriter {
    rows: DenseRows,
    images: Option<SyncSender<PolarImage>>,
    thread: Option<JoinHandle<()>>,
    done: Arc<Done>,
    dropped: u64,
}

impl ImageWriter {
    /// Into a folder, which is made; images that are there stay.
    pub fn new(folder: &Path) -> Result<Self, Error> {
        let refused = |source| Error::Record {
            folder: folder.to_owned(),
            source,
        };
        fs::create_dir_all(folder.join("radar")).map_err(refused)?;
        let list = folder.join("radar.timestamps");
        let list = OpenOptions::new().append(true).create(true).open(list);
        let list = list.map_err(refused)?;
        let (images, waiting) = sync_channel(WAITING);
        let done = Arc::new(Done::default());
        let (doing, folder) = (Arc::clone(&done), folder.join("radar"));
        let thread = std::thread::Builder::new()
            .name("dense".to_owned())
            .spawn(move || write_all(&waiting, &folder, list, &doing))
            .map_err(refused)?;
        Ok(Self {
            rows: DenseRows::default(),
            images: Some(images),
            thread: Some(thread),
            done,
            dropped: 0,
        })
    }

    pub fn beam(&mut self, beam: &RawBeam) {
        self.rows.push(beam);
    }

    pub fn sweep(&mut self, sweep: &Sweep) {
        let image = self.rows.image(sweep);
        let sent = self.images.as_ref().map(|images| images.try_send(image));
        // The radar does not wait for a disk.
        self.dropped += u64::from(!matches!(sent, Some(Ok(()))));
    }

    pub fn counts(&self, visit: &mut dyn FnMut(Count)) {
        let value = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        visit(Count::event("images_written", value(&self.done.written)));
        visit(Count::loss("images_failed", value(&self.done.failed)));
        visit(Count::loss("images_dropped", self.dropped));
    }
}

impl Drop for ImageWriter {
    fn drop(&mut self) {
        // Without a sender the thread ends, when it has written what waits.
        self.images = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_all(images: &Receiver<PolarImage>, folder: &Path, mut list: File, done: &Done) {
    for image in images {
        let written = write(&image, folder).and_then(|()| {
            let line = format!("{} 1\n", image.stamp_us);
            list.write_all(line.as_bytes())
        });
        let counter = match written {
            Ok(()) => &done.written,
            Err(_) => &done.failed,
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }
}

/// Whole under another name, then renamed.
fn write(image: &PolarImage, folder: &Path) -> std::io::Result<()> {
    let path: PathBuf = folder.join(format!("{}.png", image.stamp_us));
    let part = path.with_extension("part");
    let width = image.width.max(1);
    let size = |pixels: usize| u32::try_from(pixels).map_err(std::io::Error::other);
    let mut out = BufWriter::new(File::create(&part)?);
    let mut encoder = png::Encoder::new(&mut out, size(width)?, size(image.bytes.len() / width)?);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&image.bytes)?;
    writer.finish()?;
    out.into_inner()?;
    fs::rename(part, path)
}
