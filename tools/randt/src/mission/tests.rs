//! Whether a mission goes on, by clocks that lie, and what is left of one whose record is broken.

use super::*;
use crate::date::BootTime;

const MINUTE_NS: i64 = 60_000_000_000;

/// A time after the last sign of life, by a date that is known or not; in a boot, at a time after
/// its beginning.
fn after(mission: &Mission, ns: i64, is_date_known: bool, boot: (&str, i64)) -> Now {
    Now {
        date_ns: mission.last_sign_ns() + ns,
        is_date_known,
        boot: BootTime {
            boot_id: boot.0.to_owned(),
            since_boot_ns: boot.1,
        },
    }
}

fn begun(folder: &Path, boot: (&str, i64)) -> Mission {
    let mut now = Now::read();
    (now.boot.boot_id, now.boot.since_boot_ns) = (boot.0.to_owned(), boot.1);
    Mission::begin(&folder.join("a"), 1, now.date_ns, &now).unwrap()
}

#[test]
fn it_goes_on_after_a_short_interruption_only() {
    let folder = tempfile::tempdir().unwrap();
    let mut mission = begun(folder.path(), ("one", MINUTE_NS));
    let rebooted = ("two", 20_000_000_000);
    assert!(mission.goes_on(&after(&mission, 9 * MINUTE_NS, true, rebooted)));
    assert!(!mission.goes_on(&after(&mission, 11 * MINUTE_NS, true, rebooted)));
    let now = after(&mission, 0, true, ("one", 2 * MINUTE_NS));
    mission.resume(&now, false).unwrap();
    assert_eq!(mission.record.power_cuts, 0, "nobody has driven");
    mission.stop(now.date_ns + 2).unwrap();
    assert!(!mission.goes_on(&after(&mission, 0, true, rebooted)));
    let read = Mission::open(mission.folder()).unwrap();
    assert_eq!(read.record, mission.record);
    assert_eq!(read.record.resumed_ns, [now.date_ns]);
}

#[test]
fn a_date_without_a_source_gives_no_age() {
    let folder = tempfile::tempdir().unwrap();
    let mission = begun(folder.path(), ("one", MINUTE_NS));
    let rebooted = ("two", 20_000_000_000);
    // 1970; a second after the last sign, where the date comes from a file; a battery's clock that
    // was reset.
    let years_ns = mission.last_sign_ns();
    for (ns, is_date_known) in [(-years_ns, false), (1, false), (-MINUTE_NS, true)] {
        let now = after(&mission, ns, is_date_known, rebooted);
        assert_eq!(mission.silent_ns(&now), None, "{now:?}");
        assert!(!mission.goes_on(&now));
    }
}

#[test]
fn within_a_boot_the_time_since_its_beginning_gives_the_age() {
    let folder = tempfile::tempdir().unwrap();
    let mission = begun(folder.path(), ("one", MINUTE_NS));
    let years_ns = mission.last_sign_ns();
    // The network has set the clock from 1970, or somebody set it back: minutes are minutes.
    for ns in [years_ns, -years_ns] {
        assert!(mission.goes_on(&after(&mission, ns, false, ("one", 9 * MINUTE_NS))));
        assert!(!mission.goes_on(&after(&mission, ns, false, ("one", 600 * MINUTE_NS))));
    }
    // It has been driving for hours and the stages were restarted just now.
    assert!(mission.goes_on(&after(&mission, MINUTE_NS, false, ("one", 600 * MINUTE_NS))));
}

#[test]
fn a_broken_record_hides_nothing_and_is_written_anew() {
    for broken in [
        "",
        "{\"randt\": \"0.1.0\", \"beg",
        "{\"randt\": 5}",
        "null",
        "\0\0\0\0",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = begun(folder.path(), ("one", 0)).folder().to_owned();
        fs::write(path.join("map.journal"), "keyframes").unwrap();
        fs::write(path.join(record::FILE), broken).unwrap();
        let mut mission = Mission::open(&path).unwrap();
        let why = mission.broken.clone().unwrap();
        assert!(why.contains("mission.json"), "{why}");
        assert!(mission.record.begun_ns > 0 && mission.record.stopped_ns.is_none());
        mission.repair().unwrap();
        let read = Mission::open(&path).unwrap();
        assert_eq!((read.broken, &read.record), (None, &mission.record));
        let kept = fs::read_to_string(path.join("mission.json.broken-1")).unwrap();
        assert_eq!(kept, broken, "nothing is thrown away");
    }
}

#[test]
fn a_record_that_is_a_folder_or_missing_is_written_anew_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = begun(folder.path(), ("one", 0)).folder().to_owned();
    fs::remove_file(path.join(record::FILE)).unwrap();
    Mission::open(&path).unwrap().repair().unwrap();
    assert!(Mission::open(&path).unwrap().broken.is_none());
    fs::remove_file(path.join(record::FILE)).unwrap();
    fs::create_dir(path.join(record::FILE)).unwrap();
    // It was stopped: there is a report.
    fs::create_dir(path.join(REPORT)).unwrap();
    fs::write(path.join(REPORT).join("report.json"), "{}").unwrap();
    let mut mission = Mission::open(&path).unwrap();
    assert!(mission.broken.is_some() && mission.record.stopped_ns.is_some());
    mission.stop(7).unwrap();
    assert!(path.join("mission.json.broken-1").is_dir());
    assert_eq!(Mission::open(&path).unwrap().record.stopped_ns, Some(7));
}

#[test]
fn what_another_version_wrote_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = begun(folder.path(), ("one", 0)).folder().to_owned();
    let newer = "{\"randt\": \"9.0.0\", \"begun_ns\": 5, \"weather\": {\"rain\": true}}";
    fs::write(path.join(record::FILE), newer).unwrap();
    let mut mission = Mission::open(&path).unwrap();
    assert_eq!((&mission.broken, mission.record.begun_ns), (&None, 5));
    mission.stop(7).unwrap();
    let text = fs::read_to_string(path.join(record::FILE)).unwrap();
    assert!(
        text.contains("\"rain\": true") && text.contains("9.0.0"),
        "{text}"
    );
}

#[test]
fn what_is_no_mission_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{:#}", Mission::open(folder.path()).unwrap_err());
    assert!(text.contains("is no mission"), "{text}");
}
