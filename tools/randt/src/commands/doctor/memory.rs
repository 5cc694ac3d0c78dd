//! Whether there is memory for every topic and for what outlives a stage. Where it runs out a
//! store is a stage's end.

use super::finding::Finding;
use super::snapshot::DomainSnapshot;
use crate::units::bytes;
use randt_messages::BUS_TOPICS;
use randt_stage::{KeyframeRing, bytes_in_use, leftovers};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

const ABOUT: &str = "memory";
const SHARED_MEMORY: &str = "/dev/shm";
/// Magic number of a file system in memory, statfs(2).
const TMPFS: u64 = 0x0102_1994;
/// The ring of keyframes, and the checkpoints of odometry and mapper.
const STATE_BYTES: usize = KeyframeRing::BYTES + (16 << 20);

/// /dev/shm holds all topics.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    let Ok(found) = rustix::fs::statvfs(SHARED_MEMORY) else {
        let fix = "mount -t tmpfs tmpfs /dev/shm";
        return vec![Finding::bad(ABOUT, "/dev/shm is not there", fix)];
    };
    let [free, size] = [found.f_bavail, found.f_blocks].map(|blocks| blocks * found.f_frsize);
    let mut used = leftovers(&snapshot.domain);
    used.retain(|file| file.path.starts_with(SHARED_MEMORY));
    // What this domain has already is there for it.
    let there = free + used.iter().map(|file| file.bytes).sum::<u64>();
    let topics = |navtech| -> usize {
        let in_use = BUS_TOPICS.iter().map(|topic| bytes_in_use(topic, navtech));
        in_use.sum()
    };
    let state = match on_shared_memory(snapshot) {
        true => STATE_BYTES,
        false => 0,
    };
    let needed = [false, true].map(|navtech| (topics(navtech) + state) as u64);
    vec![grade(there, size, needed)]
}

/// `needed`: with an iSDR-C, with a Navtech.
fn grade(there: u64, size: u64, needed: [u64; 2]) -> Finding {
    let [isdr_c, navtech] = needed;
    let text = format!(
        "{} of {} in /dev/shm are free or this domain's; it needs {} with an iSDR-C, {} with a Navtech",
        bytes(there),
        bytes(size),
        bytes(isdr_c),
        bytes(navtech)
    );
    let fix = if size < navtech {
        let enough = navtech.next_multiple_of(64 << 20) >> 20;
        format!("mount -o remount,size={enough}M /dev/shm (docker run --shm-size={enough}m)")
    } else {
        "du -a /dev/shm | sort -n | tail (remove what takes it)".to_owned()
    };
    if there < isdr_c {
        Finding::bad(ABOUT, text, fix)
    } else if there < navtech {
        Finding::warn(ABOUT, text, fix)
    } else {
        Finding::ok(ABOUT, text)
    }
}

/// The run folder is in memory and has room for what outlives a stage.
pub fn check_run_folder(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "run folder";
    let run = snapshot.domain.run();
    let shown = run.display();
    let (Ok(kind), Ok(found)) = (rustix::fs::statfs(run), rustix::fs::statvfs(run)) else {
        // The first stage makes it.
        return Vec::new();
    };
    if kind.f_type as u64 != TMPFS {
        let text = format!(
            "{shown} is not in memory: checkpoints wait for the disk, and its clock outlives a boot"
        );
        let fix = "leave --run away, or name a folder on a tmpfs (/run, /dev/shm)";
        return vec![Finding::warn(ABOUT, text, fix)];
    }
    let free = found.f_bavail * found.f_frsize + state_on_disk(snapshot);
    let needed = STATE_BYTES as u64;
    let text = format!(
        "{shown} is in memory and has {} for checkpoints, which need {}",
        bytes(free),
        bytes(needed)
    );
    let fix = format!("mount -o remount,size=64M the file system of {shown}");
    vec![match free < needed {
        true => Finding::bad(ABOUT, text, fix),
        false => Finding::ok(ABOUT, text),
    }]
}

fn state_on_disk(snapshot: &DomainSnapshot) -> u64 {
    let files = fs::read_dir(snapshot.domain.state()).into_iter().flatten();
    let sizes = files.filter_map(|file| Some(file.ok()?.metadata().ok()?.blocks() * 512));
    sizes.sum()
}

fn on_shared_memory(snapshot: &DomainSnapshot) -> bool {
    let device = |path: &Path| fs::metadata(path).ok().map(|found| found.dev());
    device(snapshot.domain.run()) == device(Path::new(SHARED_MEMORY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::finding::Grade;

    #[test]
    fn memory_is_graded_by_what_the_sensors_need() {
        let grade = |there, size| grade(there, size, [10_600_000, 24_500_000]);
        assert_eq!(grade(64_000_000, 64_000_000).grade, Grade::Ok);
        let small = grade(20_000_000, 20_000_000);
        assert_eq!(small.grade, Grade::Warn);
        assert!(small.to_string().contains("remount,size=64M"), "{small}");
        // Large enough, but somebody has filled it.
        let full = grade(1_000_000, 64_000_000);
        assert_eq!(full.grade, Grade::Bad);
        assert!(full.to_string().contains("remove what takes it"), "{full}");
    }
}
