//! All missions of a robot, and which one is the current one.
//!
//! A folder `missions` with one folder each, and beside it a link `current`, through which the stages write.

use crate::mission::Mission;
use anyhow::{Context, bail, ensure};
use randt_log::name_of_date;
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::{MetadataExt, lchown, symlink};
use std::path::{Path, PathBuf};

/// Where a robot keeps them.
pub const ROOT: &str = "/var/lib/randt";
const FOLDER: &str = "missions";
const CURRENT: &str = "current";

/// The folder of all missions.
#[derive(Clone, Debug)]
pub struct Missions {
    root: PathBuf,
}

impl Missions {
    /// Those below a folder, which must be there.
    pub fn open(root: &Path) -> anyhow::Result<Self> {
        ensure!(
            root.is_dir(),
            "{}: is not there; --root says where the missions are, and the package makes {ROOT}",
            root.display()
        );
        let missions = Self {
            root: root.to_owned(),
        };
        let folder = missions.folder();
        match fs::create_dir(&folder) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                return Err(error).with_context(|| format!("{}: cannot be made", folder.display()));
            }
            Err(_) => {}
            Ok(()) => missions.hand_over(&folder)?,
        }
        Ok(missions)
    }

    fn folder(&self) -> PathBuf {
        self.root.join(FOLDER)
    }

    /// The link to the current one.
    pub fn link(&self) -> PathBuf {
        self.root.join(CURRENT)
    }

    /// All of them, the oldest first; what is none is left out.
    pub fn all(&self) -> anyhow::Result<Vec<Mission>> {
        let folder = self.folder();
        let found = fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
        let mut missions: Vec<Mission> = found
            .flatten()
            .filter_map(|entry| Mission::open(&entry.path()).ok())
            .collect();
        missions.sort_by_key(|mission| (mission.record.begun_ns, mission.name()));
        Ok(missions)
    }

    /// One by name.
    pub fn get(&self, name: &str) -> anyhow::Result<Mission> {
        check_name(name)?;
        Mission::open(&self.folder().join(name)).with_context(|| {
            let names = self.all().unwrap_or_default();
            let names: Vec<String> = names.iter().map(Mission::name).collect();
            match names.as_slice() {
                [] => "there is no mission yet".to_owned(),
                names => format!("the missions are {}", names.join(", ")),
            }
        })
    }

    /// The one that the stages write into.
    pub fn current(&self) -> Option<Mission> {
        let folder = fs::read_link(self.link()).ok()?;
        Mission::open(&self.root.join(folder)).ok()
    }

    /// Refuses a name that a new one cannot have.
    pub fn check_free(&self, name: &str) -> anyhow::Result<()> {
        check_name(name)?;
        let folder = self.folder().join(name);
        ensure!(!folder.exists(), "{}: exists already", folder.display());
        Ok(())
    }

    /// Begins a new one, and makes it the current one.
    pub fn begin(&self, name: Option<&str>, now_ns: i64) -> anyhow::Result<Mission> {
        let mission = match name {
            Some(name) => {
                self.check_free(name)?;
                Mission::begin(&self.folder().join(name), now_ns)?
            }
            None => self.begin_unnamed(now_ns)?,
        };
        self.hand_over(mission.folder())?;
        self.point_to(&mission)?;
        Ok(mission)
    }

    /// Two may begin within a second, and a clock without a battery reads the same at each start.
    fn begin_unnamed(&self, now_ns: i64) -> anyhow::Result<Mission> {
        let date = name_of_date(now_ns);
        let free = (1..).map(|n| match n {
            1 => date.clone(),
            _ => format!("{date}-{n}"),
        });
        let mut free = free.map(|name| self.folder().join(name));
        match free.find(|folder| !folder.exists()) {
            Some(folder) => Mission::begin(&folder, now_ns),
            None => bail!("{}: all names are taken", self.folder().display()),
        }
    }

    /// The link changes at once: at no moment is there none.
    fn point_to(&self, mission: &Mission) -> anyhow::Result<()> {
        let (link, new) = (self.link(), self.root.join(".current.part"));
        let said = || format!("{}: cannot be pointed to the mission", link.display());
        // One that a kill left.
        let _ = fs::remove_file(&new);
        symlink(Path::new(FOLDER).join(mission.name()), &new).with_context(said)?;
        fs::rename(&new, &link).with_context(said)?;
        fs::File::open(&self.root)
            .and_then(|folder| folder.sync_all())
            .with_context(said)
    }

    /// Gives a folder and what is in it to the user whose the root is: an administrator's commands leave nothing that
    /// the stages cannot write.
    pub fn hand_over(&self, path: &Path) -> anyhow::Result<()> {
        let said = || format!("{}: cannot be given to the stages' user", path.display());
        let root = fs::metadata(&self.root).with_context(said)?;
        let found = fs::symlink_metadata(path).with_context(said)?;
        if (found.uid(), found.gid()) != (root.uid(), root.gid()) {
            lchown(path, Some(root.uid()), Some(root.gid())).with_context(said)?;
        }
        if found.is_dir() {
            for entry in fs::read_dir(path).with_context(said)? {
                self.hand_over(&entry.with_context(said)?.path())?;
            }
        }
        Ok(())
    }
}

/// A name becomes a folder's.
fn check_name(name: &str) -> anyhow::Result<()> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    ensure!(
        !name.is_empty() && !name.starts_with(['.', '-']) && name.chars().all(is_plain),
        "{name:?}: a mission's name consists of letters, digits, '-', '_' and '.'"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_is_the_current_one() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        assert!(missions.current().is_none());
        let first = missions.begin(None, 5_000_000_000).unwrap();
        let second = missions.begin(None, 5_900_000_000).unwrap();
        assert_eq!(first.name(), "1970-01-01T00-00-05Z");
        assert_eq!(second.name(), "1970-01-01T00-00-05Z-2");
        assert_eq!(missions.current().unwrap().name(), second.name());
        let third = missions.begin(Some("cellar"), 6_000_000_000).unwrap();
        assert!(missions.link().join("logs").is_dir());
        assert!(missions.begin(Some("cellar"), 7_000_000_000).is_err());
        let names: Vec<String> = missions.all().unwrap().iter().map(Mission::name).collect();
        assert_eq!(names, [first.name(), second.name(), third.name()]);
        let text = format!("{:#}", missions.get("attic").unwrap_err());
        assert!(text.contains("cellar"), "{text}");
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for name in ["", ".", "..", "../a", "a/b", "-x", "a b", ".hidden"] {
            assert!(check_name(name).is_err(), "{name}");
        }
        assert!(check_name("2026-11-24T13-05-10Z-2").is_ok());
    }
}
