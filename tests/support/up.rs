//! `randt up` in a realm of its own.

use randt_stage::Realm;
use std::path::Path;
use std::process::Command;

/// `randt up --play LOG --out OUT --rate 1` in a realm.
pub fn up(realm: &Realm, log: &Path, out: &Path) -> Command {
    let mut command = super::randt(&["up", "--rate", "1", "--prefix", realm.prefix(), "--play"]);
    command.arg(log).arg("--out").arg(out);
    command.arg("--run").arg(realm.run());
    command
}
