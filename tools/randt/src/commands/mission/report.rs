//! A mission's report: what `randt run` leaves, made of what the stages left behind and of the
//! logs.

use super::logged::Logged;
use crate::finish_drive::{Drive, finish_drive};
use crate::latency::Latency;
use crate::mission::{CONFIGURATION, Mission};
use crate::pipeline::Pipeline;
use crate::plain_file;
use crate::recorded::configuration;
use crate::recovered_drive::RecoveredDrive;
use crate::report::{Cost, Costs, Input};
use anyhow::Context;
use randt_config::Config;
use randt_log::Robot;
use randt_messages::OdometryState;
use randt_odometry::runtime::CheckpointStore;
use std::path::Path;

/// Writes it into a folder; gives whether data were lost. `name`: what it is called there, also
/// while it is being copied; `state`: where odometry's last state is, if that is known.
pub fn write(
    mission: &Mission,
    name: &str,
    state: Option<&Path>,
    folder: &Path,
) -> anyhow::Result<bool> {
    let config = configuration_of(mission)?;
    let use_imu = state.is_none_or(|state| uses_imu(&config, state));
    let recovered = RecoveredDrive::read(&config, use_imu, mission.folder(), state);
    let logged = Logged::read(&mission.log_files()?, &config, recovered);
    let mut counters = logged.recovered.counters;
    let first = "the logs say which";
    counters.add_lost("messages_not_recorded", logged.not_recorded, first);
    let first = logged.first_unreadable;
    counters.add_lost("logs_unreadable", logged.unreadable, first);
    let first = "what was not on the disk yet: a second of logs at most, and odometry's window";
    counters.add_lost("power_cuts", mission.record.power_cuts, first);
    let states = &logged.results.states;
    let drive = Drive {
        input: Input {
            name: name.to_owned(),
            format: "mission".into(),
            imu: states.iter().any(|state| state.imu_epoch != 0),
            imu_samples: logged.imu_samples,
            ..Input::default()
        },
        pipeline: logged.recovered.pipeline,
        results: logged.results,
        config: &config,
        counters,
        published: None,
    };
    let shown = finish_drive(drive, timing, folder)?;
    Ok(shown.context("no scan has a pose")?.lost)
}

fn timing(_: &Pipeline, states: &[OdometryState]) -> Costs {
    let compute = states.iter().filter_map(Latency::from_state);
    let compute_ns: Vec<u64> = compute.map(|l| (l.compute_ms * 1e6) as u64).collect();
    Costs::from([("compute".into(), Cost::from_times(&compute_ns))])
}

/// The one in force when the mission began.
fn configuration_of(mission: &Mission) -> anyhow::Result<Config> {
    let path = mission.folder().join(CONFIGURATION);
    let text = plain_file::read_to_string(&path).with_context(|| path.display().to_string())?;
    configuration(Robot::default(), Some(&text)).with_context(|| path.display().to_string())
}

/// Whether odometry ran with its IMU: a state without one cannot be read as one with it.
fn uses_imu(config: &Config, state: &Path) -> bool {
    let read = |use_imu| CheckpointStore::read(state, config, use_imu);
    read(true).odometry.is_ok() || read(false).odometry.is_err()
}
