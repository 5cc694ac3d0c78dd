//! A stage may be killed at any moment, and so may the one that clears it away: no slot of a
//! service stays orphaned, and the next stage starts.

use crate::support::{Other, pipeline_folder};
use randt_messages::{ImuSampleTopic, RadarScan};
use randt_stage::{Domain, Registry, Stage, WakeReason, clean_up, orphaned_slots};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// More deaths than a topic has slots for writers, and fewer than are worth waiting for.
const DEATHS: usize = 18;
/// Where a segment marks that no process may join any more.
const CLOSED_AT: u64 = 184 + 72;

fn domain(run: &Path) -> Domain {
    Domain::new("slots", Some(run)).unwrap()
}

/// What the other processes do: they have ports, and wait.
fn live(name: &str) {
    let Some(run) = pipeline_folder() else {
        return;
    };
    let mut stage = Stage::open(name, &domain(&run)).unwrap();
    let _scans = stage.publisher::<RadarScan>().unwrap();
    let _samples = stage.subscriber::<ImuSampleTopic>().unwrap();
    stage.running().unwrap();
    // From the first wait on a SIGTERM is noticed.
    stage.wait(&[], Some(Duration::ZERO)).unwrap();
    println!("ready");
    while stage.wait(&[], None).unwrap() != WakeReason::Stop {}
    stage.close().unwrap();
}

#[test]
fn keeper() {
    live("keeper");
}

#[test]
fn victim() {
    live("victim");
}

/// A run folder in which a stage lives, so that no process may wipe it.
struct Pipeline {
    run: tempfile::TempDir,
    _keeper: Other,
}

impl Pipeline {
    fn start() -> Self {
        let run = tempfile::tempdir().unwrap();
        let keeper = Other::start("slots::keeper", run.path());
        Self {
            run,
            _keeper: keeper,
        }
    }

    fn domain(&self) -> Domain {
        domain(self.run.path())
    }

    /// A stage that has lived and is killed; returns the name of its node.
    fn death(&self, of: &str) -> String {
        let before = self.nodes();
        let victim = Other::start(&format!("slots::{of}"), self.run.path());
        let mut nodes = self.nodes();
        nodes.retain(|node| !before.contains(node));
        victim.kill();
        assert_eq!(nodes.len(), 1, "{nodes:?}");
        nodes.remove(0)
    }

    /// The nodes' folders.
    fn nodes(&self) -> Vec<String> {
        let all = self.files(&self.domain().root().join("nodes"), "");
        let folders = all.into_iter().filter(|path| path.is_dir());
        folders
            .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
            .collect()
    }

    fn files(&self, folder: &Path, ending: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let paths = entries.map(|entry| entry.path());
        paths
            .filter(|path| path.to_str().unwrap().ends_with(ending))
            .collect()
    }

    /// Removes files of a dead node.
    fn forget(&self, node: &str, ending: &str) {
        let nodes = self.domain().root().join("nodes");
        let beside = self.files(&nodes, "").into_iter();
        let own = beside.filter(|path| path.is_file() && path.to_str().unwrap().contains(node));
        for path in own.chain(self.files(&nodes.join(node), "")) {
            if path.to_str().unwrap().ends_with(ending) {
                fs::remove_file(path).unwrap();
            }
        }
    }

    /// Segments of this domain's services.
    fn segments(&self) -> Vec<PathBuf> {
        let mut all = self.files(Path::new("/dev/shm"), ".dynamic");
        let prefix = self.domain().segment_prefix();
        all.retain(|path| path.to_str().unwrap().contains(&prefix));
        all
    }

    /// A stage starts and ends in order, and nothing is left of a dead one.
    fn check(&self) {
        Other::start("slots::victim", self.run.path()).stop();
        assert_eq!(orphaned_slots(&self.domain()), BTreeMap::new());
        assert_eq!(self.nodes().len(), 1, "only the keeper is there");
        let all = Registry::all(&self.domain());
        assert!(
            all.iter()
                .any(|(entry, lives)| *lives && entry.name == "keeper")
        );
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        for path in self.files(Path::new("/dev/shm"), "") {
            if path
                .to_str()
                .unwrap()
                .contains(&self.domain().segment_prefix())
            {
                let _ = fs::remove_file(path);
            }
        }
    }
}

#[test]
fn a_dead_stage_whose_files_are_gone_leaves_no_slot_taken() {
    let pipeline = Pipeline::start();
    for _ in 0..DEATHS {
        let node = pipeline.death("victim");
        let held = orphaned_slots(&pipeline.domain());
        assert!(held["radar/scan/v1"] >= 2, "{held:?}");
        pipeline.forget(&node, "");
    }
    pipeline.check();
}

#[test]
fn whoever_is_killed_while_it_clears_another_one_away_leaves_no_slot_taken() {
    let pipeline = Pipeline::start();
    for _ in 0..DEATHS {
        // The port is no longer listed, its slot is still taken.
        let node = pipeline.death("victim");
        pipeline.forget(&node, ".port_tag");
    }
    pipeline.check();
    for _ in 0..DEATHS {
        let node = pipeline.death("victim");
        pipeline.forget(&node, ".service_tag");
    }
    pipeline.check();
}

#[test]
fn a_service_that_was_closed_and_not_removed_is_made_anew() {
    let pipeline = Pipeline::start();
    let kept = pipeline.segments();
    let node = pipeline.death("reader");
    let mut own = pipeline.segments();
    own.retain(|path| !kept.contains(path));
    assert_eq!(own.len(), 2, "the topic and its notices");
    // Its last stage was killed after it had closed them, and its files are gone.
    pipeline.forget(&node, "");
    for path in &own {
        let segment = File::options().write(true).open(path).unwrap();
        let closed = u64::MAX.to_le_bytes();
        segment.write_all_at(&closed, CLOSED_AT).unwrap();
    }
    Other::start("slots::reader", pipeline.run.path()).stop();
    pipeline.check();
}

/// A stage with a topic that no other one has.
#[test]
fn reader() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    let mut stage = Stage::open("reader", &domain(&run)).unwrap();
    let _states = stage
        .subscriber::<randt_messages::OdometryStateTopic>()
        .unwrap();
    stage.running().unwrap();
    // From the first wait on a SIGTERM is noticed.
    stage.wait(&[], Some(Duration::ZERO)).unwrap();
    println!("ready");
    while stage.wait(&[], None).unwrap() != WakeReason::Stop {}
    stage.close().unwrap();
}

#[test]
fn a_service_without_its_segment_is_made_anew() {
    let pipeline = Pipeline::start();
    let kept = pipeline.segments();
    let node = pipeline.death("reader");
    pipeline.forget(&node, "");
    let mut own = pipeline.segments();
    own.retain(|path| !kept.contains(path));
    // One is removed, the other one is cut short.
    fs::remove_file(&own[0]).unwrap();
    File::options()
        .write(true)
        .open(&own[1])
        .unwrap()
        .set_len(300)
        .unwrap();
    Other::start("slots::reader", pipeline.run.path()).stop();
    pipeline.check();
}

#[test]
fn what_nobody_living_holds_is_freed_while_others_live() {
    let pipeline = Pipeline::start();
    let node = pipeline.death("victim");
    pipeline.forget(&node, "");
    pipeline.death("victim");
    let held: usize = orphaned_slots(&pipeline.domain()).values().sum();
    let done = clean_up(&pipeline.domain()).unwrap();
    assert_eq!((done.slots, done.services), (held, 0));
    assert_eq!(orphaned_slots(&pipeline.domain()), BTreeMap::new());
    // Nothing of the stages that live was touched.
    assert_eq!(
        clean_up(&pipeline.domain()).unwrap(),
        randt_stage::CleanUp::default()
    );
    pipeline.check();
}
