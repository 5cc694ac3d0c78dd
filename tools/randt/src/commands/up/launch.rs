//! Which programs make up a pipeline, and with what options.

use super::Arguments;
use super::program::Program;
use super::watch::STAGES;
use crate::output::write_private;
use anyhow::ensure;
use randt_config::{Config, Loaded, Selection};
use randt_stage::Domain;
use std::path::Path;

/// What stands in for the drivers.
pub const PLAY: &str = "play";

/// All stages but those at the beginning of the data's way, the last one first: each writes to
/// those before it.
pub fn stages(
    arguments: &Arguments,
    domain: &Domain,
    profile: &Path,
    journal: &Path,
) -> anyhow::Result<Vec<Program>> {
    let mut programs = Vec::new();
    if let Some(folder) = &arguments.record {
        let mut program = stage("recorder", domain, profile)?;
        program.option("--out", std::path::absolute(folder)?);
        programs.push(program);
    }
    if arguments.view {
        programs.push(stage("view", domain, profile)?);
    }
    for name in STAGES.into_iter().rev() {
        let mut program = stage(name, domain, profile)?;
        match name {
            "mapper" => program.option("--journal", journal),
            "odometry" if arguments.no_imu => program.flag("--no-imu"),
            _ => {}
        }
        programs.push(program);
    }
    Ok(programs)
}

/// What stands at the beginning of the data's way.
pub fn sources(
    arguments: &Arguments,
    domain: &Domain,
    profile: &Path,
) -> anyhow::Result<Vec<Program>> {
    if let Some(log) = &arguments.play {
        let mut program = Program::command(PLAY, domain)?;
        program.flag(log);
        program.flag("--stay");
        program.option("--rate", arguments.rate.to_string());
        for argument in arguments.options.as_arguments() {
            program.flag(argument);
        }
        return Ok(vec![program]);
    }
    // The one first whose data the other's wait for.
    let drivers: &[&str] = match (arguments.no_drivers, arguments.no_imu) {
        (true, _) => &[],
        (_, true) => &["radar"],
        _ => &["imu", "radar"],
    };
    let programs = drivers.iter().map(|name| stage(name, domain, profile));
    programs.collect()
}

fn stage(name: &str, domain: &Domain, profile: &Path) -> anyhow::Result<Program> {
    let mut program = Program::stage(name, domain)?;
    program.option("--profile", profile);
    Ok(program)
}

/// The configuration for the stages, exactly as it is in force here.
pub fn write_profile(path: &Path, loaded: &Loaded) -> anyhow::Result<()> {
    write_private(path, loaded.to_toml().as_bytes())?;
    let read = Config::load(&Selection {
        profile: Some(path.display().to_string()),
        ..Selection::default()
    })?;
    ensure!(
        read.config == loaded.config,
        "{}: does not read back as it was written",
        path.display()
    );
    Ok(())
}
