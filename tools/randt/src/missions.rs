//! All missions of a robot, and which one is the current one.
//!
//! A folder `missions` with one folder each, and beside it a link `current`, through which the
//! stages write.

use crate::date::Now;
use crate::mission::Mission;
use crate::output::warn;
use anyhow::{Context, ensure};
use randt_log::name_of_date;
use rustix::fs::{Mode, OFlags};
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

/// Where a robot keeps them.
pub const ROOT: &str = "/var/lib/randt";
const FOLDER: &str = "missions";
const CURRENT: &str = "current";
/// Where a mission goes on its way out.
const DELETED: &str = ".deleted";
/// Bytes of a name: a folder's has 255 at most, and exports add to it.
const NAME_MAX: usize = 100;

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
        let context = || format!("{}: cannot be made", folder.display());
        match fs::create_dir(&folder) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                Err(error).with_context(context)
            }
            _ => Ok(missions),
        }
    }

    fn folder(&self) -> PathBuf {
        self.root.join(FOLDER)
    }

    /// The link to the current one.
    pub fn link(&self) -> PathBuf {
        self.root.join(CURRENT)
    }

    /// Waits until no other command begins or ends a mission, and keeps others from it.
    pub fn lock(&self) -> anyhow::Result<fs::File> {
        let path = self.folder();
        // Of a pipe it would be waited for a writer.
        let folder = rustix::fs::open(&path, OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty());
        let folder = fs::File::from(folder.with_context(|| path.display().to_string())?);
        if folder.try_lock().is_err() {
            warn("another command works on the missions; it is waited for");
            let locked = folder.lock();
            locked.with_context(|| format!("{}: cannot be locked", path.display()))?;
        }
        Ok(folder)
    }

    /// All of them, the oldest first; what is none is left out.
    pub fn all(&self) -> anyhow::Result<Vec<Mission>> {
        let folder = self.folder();
        let found = fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
        let found = found.flatten().map(|entry| entry.path());
        let mut missions: Vec<Mission> = found.filter_map(|it| Mission::open(&it).ok()).collect();
        // A record that cannot be read has lost its number: the date shows where it belongs.
        let records = missions.iter().map(|it| &it.record);
        let numbers: Vec<_> = records.map(|it| (it.begun_ns, it.number)).collect();
        for broken in missions.iter_mut().filter(|it| it.broken.is_some()) {
            let record = &mut broken.record;
            let numbers = numbers.iter();
            let before = numbers.filter(|(begun_ns, _)| *begun_ns < record.begun_ns);
            record.number = before.map(|(_, number)| *number).max().unwrap_or(0);
        }
        missions.sort_by_key(|it| (it.record.number, it.record.begun_ns, it.name()));
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

    /// The one that the stages write into. A link that leads to none is an error.
    pub fn current(&self) -> anyhow::Result<Option<Mission>> {
        let link = self.link();
        let shown = link.display();
        let folder = match fs::read_link(&link) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            folder => folder.with_context(|| format!("{shown}: is no link to a mission"))?,
        };
        let mission = Mission::open(&self.root.join(folder));
        let mission = mission.with_context(|| format!("{shown}: leads to no mission"))?;
        Ok(Some(mission))
    }

    /// The same for callers that go on without one: a link that leads to none is a warning.
    pub fn current_or_none(&self) -> Option<Mission> {
        self.current().unwrap_or_else(|error| {
            warn(&format!("{error:#}"));
            None
        })
    }

    /// The date, as far as it is known: it cannot be before the last sign of life of any mission.
    pub fn date_ns(&self, now: &Now) -> anyhow::Result<i64> {
        if now.is_date_known {
            return Ok(now.date_ns);
        }
        let all = self.all()?;
        let signs = all.iter().map(Mission::last_sign_ns);
        Ok(signs.fold(now.date_ns, i64::max))
    }

    /// Refuses a name that a new one cannot have.
    pub fn check_free(&self, name: &str) -> anyhow::Result<()> {
        check_name(name)?;
        let folder = self.folder().join(name);
        ensure!(!folder.exists(), "{}: exists already", folder.display());
        Ok(())
    }

    /// Begins a new one, and makes it the current one.
    pub fn begin(&self, name: Option<&str>, now: &Now) -> anyhow::Result<Mission> {
        let newest = self.all()?.iter().map(|it| it.record.number).max();
        let number = newest.unwrap_or(0) + 1;
        let date_ns = self.date_ns(now)?;
        let folder = match name {
            Some(name) => {
                self.check_free(name)?;
                self.folder().join(name)
            }
            None => self.free_folder(date_ns)?,
        };
        let mission = Mission::begin(&folder, number, date_ns, now)?;
        self.point_to(&mission)?;
        Ok(mission)
    }

    /// Two may begin within a second, and a clock without a battery reads the same at each start.
    fn free_folder(&self, date_ns: i64) -> anyhow::Result<PathBuf> {
        let date = name_of_date(date_ns);
        let free = (1..).map(|n| match n {
            1 => date.clone(),
            _ => format!("{date}-{n}"),
        });
        let mut free = free.map(|name| self.folder().join(name));
        let free = free.find(|folder| !folder.exists());
        free.with_context(|| format!("{}: all names are taken", self.folder().display()))
    }

    /// Removes one that is not the current one, with all that it holds. One whose removal was cut
    /// short is no mission any more.
    pub fn delete(&self, mission: &Mission) -> anyhow::Result<()> {
        let current = self.current_or_none().map(|current| current.name());
        ensure!(
            current.as_ref() != Some(&mission.name()),
            "{}: is the current mission; `randt mission new` begins another one",
            mission.name()
        );
        ensure!(
            !mission.is_written(),
            "{}: a mapper writes its map",
            mission.name()
        );
        let (folder, gone) = (mission.folder(), self.root.join(DELETED));
        let context = || format!("{}: cannot be removed", folder.display());
        // What an earlier removal left.
        let _ = fs::remove_dir_all(&gone);
        fs::rename(folder, &gone).with_context(context)?;
        fs::remove_dir_all(&gone).with_context(context)
    }

    /// The link changes at once: at no moment is there none.
    fn point_to(&self, mission: &Mission) -> anyhow::Result<()> {
        let (link, new) = (self.link(), self.root.join(".current.part"));
        let context = || format!("{}: cannot be pointed to the mission", link.display());
        // One that a kill left.
        let _ = fs::remove_file(&new);
        symlink(Path::new(FOLDER).join(mission.name()), &new).with_context(context)?;
        fs::rename(&new, &link).with_context(context)?;
        fs::File::open(&self.root)
            .and_then(|folder| folder.sync_all())
            .with_context(context)
    }
}

/// A name becomes a folder's, and stands in lines of text.
fn check_name(name: &str) -> anyhow::Result<()> {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ');
    let is_tidy = name.trim() == name && !name.starts_with(['.', '-']);
    ensure!(
        !name.is_empty() && is_tidy && name.chars().all(is_plain) && name.len() <= NAME_MAX,
        "{name:?}: a mission's name consists of letters, digits, blanks, '-', '_' and '.', of at most \
         {NAME_MAX} bytes, and begins with a letter, a digit or '_'"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(date_ns: i64, is_date_known: bool) -> Now {
        Now {
            date_ns,
            is_date_known,
            ..Now::default()
        }
    }

    fn names(missions: &Missions) -> Vec<String> {
        missions.all().unwrap().iter().map(Mission::name).collect()
    }

    #[test]
    fn the_newest_is_the_current_one() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        assert!(missions.current().unwrap().is_none());
        let first = missions.begin(None, &at(5_000_000_000, true)).unwrap();
        let second = missions.begin(None, &at(5_900_000_000, true)).unwrap();
        assert_eq!(first.name(), "1970-01-01T00-00-05Z");
        assert_eq!(second.name(), "1970-01-01T00-00-05Z-2");
        let current = missions.current().unwrap().unwrap();
        assert_eq!(current.name(), second.name());
        let third = missions
            .begin(Some("cellar"), &at(6_000_000_000, true))
            .unwrap();
        assert!(missions.link().join("logs").is_dir());
        let taken = missions.begin(Some("cellar"), &at(7_000_000_000, true));
        assert!(taken.is_err());
        assert_eq!(
            names(&missions),
            [first.name(), second.name(), third.name()]
        );
        let text = format!("{:#}", missions.get("attic").unwrap_err());
        assert!(text.contains("cellar"), "{text}");
    }

    #[test]
    fn a_clock_that_begins_in_1970_again_and_again_keeps_the_order() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        let begun: Vec<String> = (0..12)
            .map(|_| {
                missions
                    .begin(None, &at(20_000_000_000, false))
                    .unwrap()
                    .name()
            })
            .collect();
        assert_eq!(names(&missions), begun);
        // What was written before shows that it is later than 1970. Only the first one has nothing
        // to go by.
        assert!(begun[0].starts_with("1970"), "{begun:?}");
        assert!(
            begun[1..].iter().all(|name| !name.starts_with("1970")),
            "{begun:?}"
        );
        // The first that knows the date again stands behind them, though they bear later ones.
        let known = missions
            .begin(None, &at(1_000_000_000_000_000_000, true))
            .unwrap();
        assert_eq!(names(&missions).last(), Some(&known.name()));
    }

    #[test]
    fn a_broken_record_stands_where_it_stood() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        let now_ns = Now::read().date_ns;
        let begun = [-40, -20, 100].map(|s| {
            let now = at(now_ns + s * 1_000_000_000, true);
            missions.begin(None, &now).unwrap()
        });
        fs::write(begun[1].folder().join("mission.json"), "{").unwrap();
        let all = missions.all().unwrap();
        assert_eq!(names(&missions), begun.each_ref().map(Mission::name));
        assert!(all[1].broken.is_some() && all[0].broken.is_none());
    }

    #[test]
    fn a_mission_is_deleted_unless_it_is_the_current_one() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        let [old, current] =
            ["Kühlhaus Süd", "attic"].map(|name| missions.begin(Some(name), &at(5, true)).unwrap());
        let text = format!("{:#}", missions.delete(&current).unwrap_err());
        assert!(text.contains("is the current mission"), "{text}");
        missions.delete(&old).unwrap();
        assert_eq!(names(&missions), ["attic"]);
        assert!(!root.path().join(DELETED).exists() && missions.get("Kühlhaus Süd").is_err());
    }

    #[test]
    fn a_link_that_leads_nowhere_is_named() {
        let root = tempfile::tempdir().unwrap();
        let missions = Missions::open(root.path()).unwrap();
        let mission = missions.begin(None, &at(5, true)).unwrap();
        fs::remove_dir_all(mission.folder()).unwrap();
        let text = format!("{:#}", missions.current().unwrap_err());
        assert!(text.contains("current: leads to no mission"), "{text}");
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let long = "x".repeat(101);
        for name in [
            "",
            ".",
            "..",
            "../a",
            "a/b",
            "-x",
            " a",
            "a ",
            ".hidden",
            "a\nb",
            "a\u{202e}b",
            &long,
        ] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
        for name in ["2026-11-24T13-05-10Z-2", "Kühlhaus Süd 2", "a b"] {
            assert!(check_name(name).is_ok(), "{name}");
        }
    }
}
