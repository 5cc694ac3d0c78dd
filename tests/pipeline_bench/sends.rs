//! Bytes through write and send, of every stage. Tracing slows a stage down: times are not taken
//! here.

use super::drive::Stages;
use crate::support::calls;
use crate::support::stages::RunFolder;
use std::path::Path;
use std::time::Duration;

/// How long each process is traced.
const SPAN: Duration = Duration::from_secs(2);
/// The histories are handed over before that.
const BEFORE: Duration = Duration::from_secs(2);

/// Plays a log and prints the rates.
pub fn print(folder: &RunFolder, log: &Path) {
    println!("\nwrite and send calls, seen with strace for {SPAN:?} each");
    let mut stages = Stages::start(folder, log, "bench-calls", None);
    let mut play = stages.play(log);
    std::thread::sleep(BEFORE);
    // The mapper last: the robot stands at first, and there is nothing to write.
    for running in [&play].into_iter().chain(stages.running.iter().rev()) {
        match calls::watch(running, SPAN) {
            Some(calls) => println!(
                "{:<9} {:.1} kB/s in {:.0} writes/s, {:.1} kB/s in {:.0} sends/s",
                running.name, calls.written_kb_s, calls.writes_s, calls.sent_kb_s, calls.sends_s
            ),
            None => println!("{}: not counted, strace is not there", running.name),
        }
    }
    play.stop();
    stages.stop();
}
