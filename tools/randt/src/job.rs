//! One computation: a source through the pipeline into results, with progress and Ctrl-C.

use crate::pipeline::Pipeline;
use crate::report::{Count, Counters};
use crate::results::Results;
use indicatif::ProgressBar;
use randt_config::{Config, Loaded};
use randt_filter::check_sweep;
use randt_messages::{ImuUse, OdometryState, Trust, TrustReason};
use randt_readers::{Event, Extrinsics, Source};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// This number of misfitting scans before any good one means that the input is another sensor's.
const MISFITS_MAX: u64 = 5;

/// Shorter drives are not judged by how many scans fit: the first one of a frame never does, and
/// seven of eleven real scans of a Navtech do not under a profile for other sensors, at poses that
/// are right.
const JUDGED_SCANS: u64 = 20;

/// Set by Ctrl-C; work ends at the next scan.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// What a computation gave.
pub struct Done {
    /// Poses and map.
    pub results: Results,
    /// The pipeline at its end: counters and timing.
    pub pipeline: Pipeline,
    /// Time to read each scan and what lies before it, ns.
    pub read_ns: Vec<u64>,
    /// IMU samples read.
    pub imu_samples: u64,
    /// Whether the IMU was to be used.
    pub use_imu: bool,
    /// Scans without a return.
    pub empty: u64,
    /// Scans left out because they cannot be this sensor's.
    pub misfits: u64,
    /// Why the first of them.
    pub first_misfit: Option<randt_config::Error>,
    /// Stamp of the scan with which a fault of the IMU was named for the first time.
    pub imu_fault_ns: Option<i64>,
    /// Whether Ctrl-C ended it before the input did.
    pub interrupted: bool,
}

impl Done {
    /// What was left out, and why.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters::default();
        if let Some(misfit) = &self.first_misfit {
            let first = misfit.to_string();
            counters.add_lost("scans_not_of_this_sensor", self.misfits, first);
        }
        let scans = self.read_ns.len() as u64;
        let first = format!("of {scans} scans without a single return");
        match 2 * self.empty > scans {
            true => counters.add_lost("scans_empty", self.empty, first),
            false => counters.add(
                "scans_empty",
                Count {
                    count: self.empty,
                    first,
                    loss: false,
                },
            ),
        }
        let states = &self.results.states;
        let unfit = states.iter().filter(|state| does_not_fit(state)).count() as u64;
        if scans >= JUDGED_SCANS && 2 * unfit > scans {
            let first = format!(
                "of {scans} scans: what the radar sees is not what the map, the gyro and the stamps say (--no-imu shows whether it is the gyro, --profile whether it is the settings)"
            );
            counters.add_lost("scans_not_fitting", unfit, first);
        }
        let is_used = |state: &OdometryState| state.imu_use != ImuUse::None as u32;
        let is_refused = self.pipeline.counters().scans_gyro_refused > 0;
        if self.use_imu && self.imu_samples > 0 && !is_refused && !states.iter().any(is_used) {
            let first = format!("{} samples cover 0 of {scans} scans", self.imu_samples);
            counters.add_lost("imu_covers_no_scan", 1, first);
        }
        if self.interrupted {
            counters.add_lost("interrupted", 1, "the input was not read to its end");
        }
        counters
    }

    /// Ends the drive where no files are wanted.
    pub fn finish(&mut self) {
        self.pipeline.finish(&mut self.results);
    }
}

/// Whether a scan has no pose of its own.
fn does_not_fit(state: &OdometryState) -> bool {
    let reasons = TrustReason::Unsupported as u32 | TrustReason::Fit as u32;
    state.trust() != Trust::Good && state.trust_reasons & reasons != 0
}

/// Lets Ctrl-C, SIGTERM and a closed terminal (SIGHUP) end the work cleanly. A second handler in
/// one process is refused; that is no failure.
pub fn catch_interrupts() {
    let _ = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed));
}

/// Whether the user has asked for the end.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Takes from the input what it knows and the configuration does not: mounting, width of the range
/// bins, whether returns have an intensity. Sets the width for the input too.
pub fn fit_input(loaded: Loaded, source: &mut dyn Source) -> Result<Loaded, randt_config::Error> {
    let mut loaded = with_mounting(loaded, source);
    if let Some(bins) = source.info().bin_size {
        source.set_bin_size(loaded.take_bin_size(bins.bins, bins.size_m)?);
    }
    if source.info().without_intensity.is_some() {
        loaded.without_intensity();
    }
    Ok(loaded)
}

/// Takes the mounting from the input where none is configured.
pub fn with_mounting(loaded: Loaded, source: &dyn Source) -> Loaded {
    mounted(loaded, &source.info().extrinsics)
}

/// Takes the mounting from an input's extrinsics, likewise.
pub fn mounted(mut loaded: Loaded, extrinsics: &Extrinsics) -> Loaded {
    let mut robot = loaded.config.robot.clone();
    if let Some(radar) = extrinsics.radar {
        (robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad) =
            (radar.x_m, radar.y_m, radar.yaw_rad);
    }
    if let Some(imu) = extrinsics.imu {
        (robot.imu_roll_rad, robot.imu_pitch_rad, robot.imu_yaw_rad) = imu.roll_pitch_yaw();
    }
    loaded.mount(robot);
    loaded
}

/// Runs a source to its end. The drive is not over by that: its last scans are still in odometry's
/// window, for [`crate::finish_drive`] or [`Done::finish`].
pub fn run(
    source: &mut dyn Source,
    config: &Config,
    use_imu: bool,
    bar: &ProgressBar,
) -> anyhow::Result<Done> {
    let mut done = Done {
        results: Results::default(),
        pipeline: Pipeline::new(config, use_imu),
        read_ns: Vec::new(),
        imu_samples: 0,
        use_imu,
        empty: 0,
        misfits: 0,
        first_misfit: None,
        imu_fault_ns: None,
        interrupted: false,
    };
    let mut reading = Instant::now();
    let mut read_ns = 0;
    while let Some(event) = source.next_event()? {
        read_ns += reading.elapsed().as_nanos() as u64;
        match &event {
            Event::Truth(truth) => done.results.add_truth(truth),
            Event::Imu(_) => done.imu_samples += 1,
            Event::Twist(_) => {}
            Event::Scan(scan) => {
                done.read_ns.push(std::mem::take(&mut read_ns));
                bar.inc(1);
                done.empty += u64::from(scan.items.is_empty());
                if let Err(misfit) = check_sweep(&scan.head.sweep, config) {
                    done.misfits += 1;
                    // One damaged scan is stepped over; another sensor's input is refused.
                    if done.misfits >= MISFITS_MAX && done.results.states.is_empty() {
                        return Err(misfit.into());
                    }
                    done.first_misfit.get_or_insert(misfit);
                    continue;
                }
            }
        }
        done.pipeline.push(&event, &mut done.results);
        let is_scan = matches!(event, Event::Scan(_));
        if is_scan && done.imu_fault_ns.is_none() && done.pipeline.counters().has_imu_fault() {
            done.imu_fault_ns = done.results.states.last().map(|it| it.header.stamp_ns);
        }
        if interrupted() {
            done.interrupted = true;
            break;
        }
        reading = Instant::now();
    }
    bar.finish_and_clear();
    Ok(done)
}
