//! The pipeline under systemd, as far as missions stop and start it.

use crate::identity::Identity;
use anyhow::{Context, ensure};
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

/// What all stages belong to.
const UNIT: &str = "randt.target";
/// What is there where systemd runs this machine.
const RUNNING: &str = "/run/systemd/system";

/// Stops the pipeline if it runs; gives whether it did.
pub fn stop() -> anyhow::Result<bool> {
    let runs = Path::new(RUNNING).is_dir()
        && as_caller(|| {
            Command::new("systemctl")
                .args(["is-active", "--quiet", UNIT])
                .stderr(Stdio::null())
                .status()
        })
        .is_ok_and(|status| status.success());
    if runs {
        // Stages are part of the target, so that they stop with it; this waits for the last of
        // them.
        systemctl(&["stop", UNIT, "randt-*.service"])?;
    }
    Ok(runs)
}

/// Starts it.
pub fn start() -> anyhow::Result<()> {
    systemctl(&["start", UNIT])
}

/// Units are root's to start and stop, no matter who owns the missions.
fn as_caller<T>(run: impl FnOnce() -> io::Result<T>) -> anyhow::Result<T> {
    Identity::of_caller().run(|| run().context("systemctl cannot be started"))
}

fn systemctl(arguments: &[&str]) -> anyhow::Result<()> {
    let output = as_caller(|| Command::new("systemctl").args(arguments).output())?;
    ensure!(
        output.status.success(),
        "systemctl {}: {}; it may need sudo",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stderr).trim()
    );
    Ok(())
}
