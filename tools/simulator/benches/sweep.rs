//! Time of one simulated sweep: `cargo bench -p randt-simulator`.

use randt_simulator::{Event, Robot, Simulation, World};
use std::time::Instant;

fn main() {
    let mut times_ms = Vec::new();
    let mut returns = 0;
    let simulation = Simulation::new(&World::building(), Robot::default(), 400, 1);
    let mut begin = Instant::now();
    // The sweep is computed when its truth is asked for; everything between two sweeps counts as
    // theirs.
    for event in simulation {
        if let Event::Scan(scan) = event {
            times_ms.push(begin.elapsed().as_secs_f64() * 1e3);
            returns += scan.items.len();
            begin = Instant::now();
        }
    }
    times_ms.sort_by(f64::total_cmp);
    let at = |share: f64| {
        times_ms
            .get((times_ms.len() as f64 * share) as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    let processor = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = processor
        .lines()
        .find_map(|line| line.strip_prefix("model name\t: "))
        .unwrap_or("unknown");
    println!(
        "{model}, one core, {} sweeps of {} returns",
        times_ms.len(),
        returns / times_ms.len().max(1)
    );
    println!("median {:.2} ms, p99 {:.2} ms a sweep", at(0.5), at(0.99));
}
