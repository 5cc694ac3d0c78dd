//! `randt up` in a domain of its own.

use randt_stage::Domain;
use std::path::Path;
use std::process::Command;

/// Other tests load the machine: a sample that comes late is waited for, so that a live pipeline
/// and `randt run`, both with this setting, use the same ones.
pub const PATIENT: [&str; 2] = ["--set", "odometry.imu_wait_max_s=20"];

/// `randt up --play LOG --out OUT --rate 1` in a domain, patient.
pub fn up(domain: &Domain, log: &Path, out: &Path) -> Command {
    let mut command = super::randt(&["up", "--rate", "1", "--prefix", domain.prefix(), "--play"]);
    command.arg(log).arg("--out").arg(out).args(PATIENT);
    command.arg("--run").arg(domain.run());
    command
}
