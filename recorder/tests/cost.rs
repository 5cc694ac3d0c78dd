//! What recording costs: `cargo bench -p randt-recorder`. Prints the share of one core and
//! gigabytes an hour for the radar and the IMU of an iSDR-C, written to a real disk as fast as it
//! goes.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "a bench reports failures by panicking, and measures"
)]

mod support;

use randt_recorder::{Disk, Settings};
use rustix::time::{ClockId, clock_gettime};
use support::{BEGIN_NS, Drive, S, loaded, recorder};

/// Seconds of drive.
const SECONDS: i64 = 60;

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let settings = Settings::from_config(&loaded().config.record);
    let mut recorder = recorder(Disk::new(folder.path()), settings);
    let mut drive = Drive::new(10_000);
    let mut spent_s = 0.0;
    for step in 0..SECONDS * 10 {
        let now_ns = BEGIN_NS + step * S / 10;
        // Making the messages is not recording them.
        let raws = drive.until(now_ns);
        let begin_s = processor_s();
        recorder.tick(now_ns);
        raws.into_iter().for_each(|raw| recorder.push(raw, now_ns));
        spent_s += processor_s() - begin_s;
    }
    recorder.finish(BEGIN_NS + SECONDS * S);
    let files = std::fs::read_dir(folder.path()).unwrap().flatten();
    let bytes: u64 = files.map(|file| file.metadata().unwrap().len()).sum();
    println!(
        "{:.2} % of a core, {:.2} GB/h",
        100.0 * spent_s / SECONDS as f64,
        bytes as f64 / SECONDS as f64 * 3600.0 * 1e-9
    );
}

/// Processor time of this process so far.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
