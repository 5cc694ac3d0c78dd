//! Which drives the bench consists of: worlds, seeds, faults. All that is fixed before anything is
//! measured.

use crate::faults::Fault;
use anyhow::{Context, bail};
use randt::digest;
use randt_simulator::World;
use std::fs;
use std::path::Path;

/// Worlds that are hard, beside those that come with the simulator: what each is like stands in
/// its text.
const HARD_WORLDS: [(&str, &str); 12] = [
    ("corridor", include_str!("../../../worlds/corridor.world")),
    (
        "glassfront",
        include_str!("../../../worlds/glassfront.world"),
    ),
    ("openfloor", include_str!("../../../worlds/openfloor.world")),
    (
        "outandback",
        include_str!("../../../worlds/outandback.world"),
    ),
    ("twofloors", include_str!("../../../worlds/twofloors.world")),
    ("ring", include_str!("../../../worlds/ring.world")),
    ("ringrough", include_str!("../../../worlds/ringrough.world")),
    ("cells", include_str!("../../../worlds/cells.world")),
    ("racks", include_str!("../../../worlds/racks.world")),
    ("office", include_str!("../../../worlds/office.world")),
    ("tee", include_str!("../../../worlds/tee.world")),
    (
        "roundabout",
        include_str!("../../../worlds/roundabout.world"),
    ),
];
/// Seeds of each drive without a fault: 1 to this.
pub(super) const SEEDS: u64 = 3;
/// Seeds, and so onsets, of each fault.
pub(super) const FAULT_SEEDS: u64 = 5;
/// Where faults are injected: where the pose is fixed everywhere without one.
pub(super) const FAULT_WORLDS: [&str; 2] = ["building", "yard"];
/// Sweeps of a drive with a fault: onsets are up to 60 s, faults up to 20 s, the rest is for
/// coming back.
const FAULT_SCANS: u64 = 800;
/// The short form: one world of either kind, up to the first minute.
pub(super) const QUICK_WORLDS: [&str; 2] = ["building", "corridor"];
pub(super) const QUICK_SCANS: u64 = 150;

/// One drive.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Trial {
    /// Name of its world.
    pub world: String,
    /// First digits of the hash of what is in that world.
    pub world_sha256: String,
    /// What is wrong.
    pub fault: Fault,
    /// Seed of drive and fault.
    pub seed: u64,
    /// Sweeps.
    pub scans: u64,
}

/// What was asked for.
#[derive(Clone, Debug)]
pub(super) struct Request<'a> {
    /// Names, files and folders; all of the program's where there are none.
    pub worlds: &'a [String],
    /// For all of the worlds; where there are none, all faults in those of [`FAULT_WORLDS`].
    pub faults: &'a [Fault],
    /// Seeds 1 to this.
    pub seeds: Option<u64>,
    /// Sweeps of each drive.
    pub scans: Option<u64>,
}

/// The worlds and all drives through them, in order.
pub(super) fn plan(request: &Request<'_>) -> anyhow::Result<(Vec<World>, Vec<Trial>)> {
    let mut worlds = Vec::new();
    if request.worlds.is_empty() {
        let hard = HARD_WORLDS.iter().map(|(name, _)| *name);
        for name in World::NAMES.into_iter().chain(hard) {
            worlds.push(named(name)?);
        }
    }
    for name in request.worlds {
        worlds.extend(read(name)?);
    }
    let mut trials = Vec::new();
    for world in &worlds {
        let mut world_sha256 = digest::of_bytes(format!("{world:?}").as_bytes());
        world_sha256.truncate(8);
        let has_faults = FAULT_WORLDS.contains(&world.name.as_str());
        for fault in faults(request, has_faults) {
            let seeds = match fault {
                Fault::None => SEEDS,
                _ => FAULT_SEEDS,
            };
            let scans = match fault {
                Fault::None => world.sweeps(),
                _ => FAULT_SCANS,
            };
            for seed in 1..=request.seeds.unwrap_or(seeds) {
                trials.push(Trial {
                    world: world.name.clone(),
                    world_sha256: world_sha256.clone(),
                    fault,
                    seed,
                    scans: request.scans.unwrap_or(scans),
                });
            }
        }
    }
    Ok((worlds, trials))
}

fn faults(request: &Request<'_>, has_faults: bool) -> Vec<Fault> {
    use clap::ValueEnum;
    match request.faults {
        [] if has_faults => Fault::value_variants().to_vec(),
        [] => vec![Fault::None],
        faults => faults.to_vec(),
    }
}

/// A world of this program.
fn named(name: &str) -> anyhow::Result<World> {
    let hard = HARD_WORLDS.iter().find(|(known, _)| *known == name);
    match hard {
        Some((name, text)) => Ok(World::parse(name, text)?),
        None => World::named(name).with_context(|| {
            let hard = HARD_WORLDS.map(|(name, _)| name).join(", ");
            let names = World::NAMES.join(", ");
            format!("unknown world {name:?}: there is {names}, {hard}, and what is in files")
        }),
    }
}

/// A world by its name, one file, or all `.world` files of a folder.
fn read(name: &str) -> anyhow::Result<Vec<World>> {
    let path = Path::new(name);
    if path.is_dir() {
        let mut files = Vec::new();
        for entry in fs::read_dir(path).with_context(|| name.to_owned())? {
            let file = entry.with_context(|| name.to_owned())?.path();
            if file.extension().is_some_and(|end| end == "world") {
                files.push(file);
            }
        }
        if files.is_empty() {
            bail!("{name}: has no file that ends in .world");
        }
        files.sort();
        return files.iter().map(|file| from_file(file)).collect();
    }
    if path.extension().is_some_and(|end| end == "world") {
        return Ok(vec![from_file(path)?]);
    }
    Ok(vec![named(name)?])
}

fn from_file(path: &Path) -> anyhow::Result<World> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    World::parse(&name, &text).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trials(worlds: &[&str], faults: &[Fault]) -> Vec<Trial> {
        let worlds: Vec<String> = worlds.iter().map(|name| (*name).to_owned()).collect();
        let request = Request {
            worlds: &worlds,
            faults,
            seeds: None,
            scans: Some(100),
        };
        plan(&request).unwrap().1
    }

    #[test]
    fn every_world_is_driven_and_faults_are_where_the_pose_is_fixed() {
        let all = trials(&[], &[]);
        let count = |world: &str, fault| {
            let found = all.iter().filter(|t| t.world == world && t.fault == fault);
            found.count() as u64
        };
        for (name, _) in HARD_WORLDS {
            assert_eq!(count(name, Fault::None), SEEDS, "{name}");
            assert_eq!(count(name, Fault::Convoy), 0, "{name}");
        }
        assert_eq!(count("yard", Fault::Convoy), FAULT_SEEDS);
        assert_eq!(
            trials(&["corridor"], &[Fault::Rain]).len() as u64,
            FAULT_SEEDS
        );
    }

    #[test]
    fn worlds_come_from_files_and_folders_and_unknown_ones_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.world");
        fs::write(&path, "wall wood 0,0 9,0\nroute 1,1 8,1 8,3\n").unwrap();
        for name in [&path, folder.path()].map(|path| path.to_str().unwrap()) {
            let trials = trials(&[name], &[]);
            assert_eq!((trials[0].world.as_str(), trials.len()), ("mine", 3));
        }
        let text = read("castle").unwrap_err().to_string();
        assert!(text.contains("tunnel, corridor"), "{text}");
    }
}
