//! What the configuration accepts runs: every key at its bounds, and bounds of two keys together.
//!
//! The stages run in a child process with bounded memory, all cases in one: an abort, too, fails
//! the test, and names the case.

use crate::support::{Ended, Random, ended_within};
use indicatif::ProgressBar;
use randt::{drive::Drive, job};
use randt_config::{Config, Rule, Section, Selection};
use randt_simulator::World;
use std::env;
use std::process::Command;
use std::time::{Duration, Instant};

/// Says to the child which cases are its own: a seed and a number of pairs.
const CASES: &str = "RANDT_BOUNDS_CASES";
/// Addresses that the child may have, KiB: 3 GB, of which most is room that is never written.
const MEMORY_MAX_KIB: u32 = 3_000_000;
/// Far more than all cases take: a hang ends here.
const TIME_MAX: Duration = Duration::from_secs(900);
/// Sweeps of the drive: a standstill of 12, then 4 m.
const SCANS: u64 = 32;

/// The values at a key's bounds.
fn bounds(section: &Section) -> Vec<String> {
    let mut sets = Vec::new();
    let default = Config::default();
    for key in section.keys {
        let values: Vec<String> = match key.rule {
            Rule::Within { least, most, .. } => vec![least.to_string(), most.to_string()],
            Rule::LossShape => vec!["-16".to_owned(), "1.5".to_owned()],
            Rule::Graduation => vec!["[1.0]".to_owned(), "[1000.0, 1.0]".to_owned()],
            Rule::NoNumber => match default.get(section.name, key.name).as_deref() {
                Some("true" | "false") => vec!["true".to_owned(), "false".to_owned()],
                _ => Vec::new(),
            },
        };
        let set = |value: &String| format!("{}.{}={value}", section.name, key.name);
        sets.extend(values.iter().map(set));
    }
    sets
}

/// Every bound by itself, then `pairs` pairs of two keys of one section; all of them where there
/// are no more.
fn cases(seed: u64, pairs: usize) -> Vec<Vec<String>> {
    let sections: Vec<Vec<String>> = Config::SECTIONS.iter().map(bounds).collect();
    let mut cases: Vec<Vec<String>> = sections.concat().into_iter().map(|set| vec![set]).collect();
    let key = |set: &str| set.split('=').next().unwrap_or_default().to_owned();
    let mut all = Vec::new();
    for section in &sections {
        for (index, a) in section.iter().enumerate() {
            let others = section.iter().skip(index + 1);
            all.extend(
                others
                    .filter(|b| key(a) != key(b))
                    .map(|b| vec![a.clone(), b.clone()]),
            );
        }
    }
    let mut random = Random(seed);
    while all.len() > pairs {
        all.swap_remove(random.below(all.len()));
    }
    cases.extend(all);
    cases
}

#[test]
#[ignore = "the child of the tests below; alone it has no cases"]
fn child() {
    let Ok(text) = env::var(CASES) else {
        return;
    };
    let (seed, pairs) = text.split_once(' ').unwrap();
    let cases = cases(seed.parse().unwrap(), pairs.parse().unwrap());
    let world = World::parse("hall", crate::support::l_shaped_world::WORLD).unwrap();
    let drive = Drive::new(&world, SCANS, 1, &ProgressBar::hidden()).unwrap();
    let (mut ran, mut refused, mut slowest) = (0, 0, (Duration::ZERO, Vec::new()));
    for set in cases {
        // Before the work, so that the last line names what ended the process.
        println!("{set:?}");
        let begin = Instant::now();
        let selection = Selection {
            set: set.clone(),
            ..Selection::default()
        };
        let loaded = match Config::load(&selection) {
            Ok(loaded) => loaded,
            Err(error) => {
                // Alone every bound is good; a refusal names the keys that do not go together.
                let text = error.to_string();
                let named = set
                    .iter()
                    .any(|set| text.contains(set.split('=').next().unwrap()));
                assert!(named, "{set:?}: {text}");
                refused += 1;
                continue;
            }
        };
        let mut source = drive.source();
        let config = job::with_mounting(loaded, &source).config;
        match job::run(&mut source, &config, true, &ProgressBar::hidden()) {
            Ok(done) => {
                assert!(done.results.states.len() as u64 <= SCANS);
                let poses = done.results.states.iter().flat_map(|state| state.pose);
                assert!(poses.into_iter().all(f64::is_finite), "{set:?}");
                done.pipeline.mapper().grid().picture();
                ran += 1;
            }
            // The sensor's figures are not the input's: refused with 78, too.
            Err(error) => {
                let configuration = error.downcast_ref::<randt_config::Error>();
                assert!(configuration.is_some(), "{set:?}: {error:#}");
                refused += 1;
            }
        }
        slowest = slowest.max((begin.elapsed(), set));
    }
    println!("{ran} ran, {refused} were refused; the slowest took {slowest:?}");
}

/// Runs all cases in a child; gives what it printed last.
fn run(seed: u64, pairs: usize) {
    println!("seed {seed}");
    let mut command = Command::new("sh");
    let limited = format!("ulimit -v {MEMORY_MAX_KIB} && exec \"$0\" \"$@\"");
    command
        .arg("-c")
        .arg(limited)
        .arg(env::current_exe().unwrap());
    command.args(["bounds::child", "--exact", "--ignored", "--nocapture"]);
    command.env(CASES, format!("{seed} {pairs}"));
    let Ended {
        code,
        stdout,
        stderr,
    } = ended_within(command, TIME_MAX);
    let last: Vec<&str> = stdout.lines().rev().take(5).collect();
    assert_eq!(code, Some(0), "{last:#?}\n{stderr}");
    let ran = stdout.lines().find(|line| line.contains(" ran, "));
    println!(
        "{}",
        ran.unwrap_or_else(|| panic!("no case was run: {stdout}"))
    );
}

#[test]
fn what_is_accepted_runs() {
    run(7, 60);
}

#[test]
#[ignore = "every pair of a section, minutes: cargo test --test programs bounds:: -- --ignored"]
fn every_pair_that_is_accepted_runs() {
    run(7, usize::MAX);
}
