//! Time that reading an input costs a sweep: `cargo bench -p randt-readers -- INPUT`.
//!
//! Without an input, the data set's stand-in, where the recordings are.

use randt_readers::{Event, Options, open};
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args_os().skip(1).find(|word| word != "--bench");
    let path = given.map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/bags/room.bag"),
        PathBuf::from,
    );
    if !path.exists() {
        println!("skipped: no data ({})", path.display());
        return Ok(());
    }
    let start = Instant::now();
    let mut source = open(&path, &Options::default())?;
    println!(
        "{}: opened in {:.1} ms",
        path.display(),
        start.elapsed().as_secs_f64() * 1e3
    );
    let (mut sweeps, mut returns, mut samples) = (0_u32, 0, 0);
    while let Some(event) = source.next_event()? {
        match event {
            Event::Scan(scan) => {
                sweeps += 1;
                returns += scan.items.len();
            }
            Event::Imu(_) => samples += 1,
            Event::Twist(_) | Event::Truth(_) => {}
        }
    }
    let whole_ms = start.elapsed().as_secs_f64() * 1e3;
    let each_ms = whole_ms / f64::from(sweeps.max(1));
    println!(
        "{sweeps} sweeps, {returns} returns, {samples} IMU samples in {whole_ms:.1} ms: {each_ms:.3} ms a sweep"
    );
    Ok(())
}
