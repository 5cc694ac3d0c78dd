//! `randt up` in a realm of its own.

use randt_stage::Realm;
use std::path::Path;
use std::process::Command;

/// Other tests load the machine: a sample that comes late is waited for, so that a live pipeline and `randt run`, if both
/// are told this, use the same ones.
pub const PATIENT: [&str; 2] = ["--set", "odometry.imu_wait_max_s=20"];

/// `randt up --play LOG --out OUT --rate 1` in a realm, patient.
pub fn up(realm: &Realm, log: &Path, out: &Path) -> Command {
    let mut command = super::randt(&["up", "--rate", "1", "--prefix", realm.prefix(), "--play"]);
    command.arg(log).arg("--out").arg(out).args(PATIENT);
    command.arg("--run").arg(realm.run());
    command
}
