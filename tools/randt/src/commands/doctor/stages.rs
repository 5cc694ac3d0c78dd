//! Whether the stages that should run do, and are of one build.

use super::finding::Finding;
use super::snapshot::{DomainSnapshot, program, start};
use crate::process::Sample;
use randt_messages::BUS_TOPICS;
use randt_stage::Entry;
use randt_version::VERSION;

/// Every stage that has not ended in order lives, and is not stopped.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "stages";
    let mut found = Vec::new();
    for (entry, lives) in &snapshot.register {
        let Entry { name, pid, .. } = entry;
        let stage = program(name);
        if !lives && !entry.ended {
            let text =
                format!("{stage} has died as process {pid}, and nobody has started it again");
            found.push(Finding::bad(ABOUT, text, start(entry)));
        }
        if *lives && Sample::read(*pid).is_some_and(|sample| sample.stopped) {
            let text = format!("{stage} (process {pid}) is stopped by a signal");
            found.push(Finding::warn(ABOUT, text, format!("kill -CONT {pid}")));
        }
    }
    if found.is_empty() {
        let names: Vec<&str> = snapshot.living().map(|entry| entry.name.as_str()).collect();
        let text = match names.as_slice() {
            [] => "none lives, none has died".to_owned(),
            names => format!("{} live, none has died", names.join(", ")),
        };
        found.push(Finding::ok(ABOUT, text));
    }
    found
}

/// The living stages have this build's layouts, and their programs are still on disk.
pub fn check_builds(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "builds";
    let mut found = Vec::new();
    for entry in snapshot.living() {
        let Entry { name, pid, .. } = entry;
        let (program, start) = (program(name), start(entry));
        let stage = format!("{program} (process {pid})");
        let restart = format!("restart {program} from this build: kill {pid}; {start}");
        if let Some((topic, theirs, ours)) = other_layout(entry) {
            let text = format!(
                "{stage} has the layout {theirs} of {topic}, this build has {ours}: neither reads the other"
            );
            found.push(Finding::bad(ABOUT, text, restart));
        } else if entry.version != VERSION {
            let text = format!("{stage} is of version {}, this is {VERSION}", entry.version);
            found.push(Finding::warn(ABOUT, text, restart));
        } else if replaced(snapshot, *pid) {
            let text = format!("the program of {stage} was replaced on disk since it started");
            found.push(Finding::warn(ABOUT, text, restart));
        }
    }
    if found.is_empty() {
        let text = match snapshot.living().next() {
            None => "no stage lives",
            Some(_) => "all living stages have this build's layouts",
        };
        found.push(Finding::ok(ABOUT, text));
    }
    found
}

/// A topic that a stage has in another layout than this build: name, its layout, ours.
fn other_layout(entry: &Entry) -> Option<(&'static str, &str, &'static str)> {
    BUS_TOPICS.iter().find_map(|topic| {
        let theirs = entry.topics.get(topic.name)?;
        (theirs != topic.type_name).then_some((topic.name, theirs.as_str(), topic.type_name))
    })
}

fn replaced(snapshot: &DomainSnapshot, pid: u64) -> bool {
    let mut inside = snapshot.inside();
    inside.any(|process| u64::from(process.pid) == pid && process.replaced)
}
