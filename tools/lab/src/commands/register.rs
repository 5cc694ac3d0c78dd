//! `randt-lab register`: the motion between two radar scans.

use anyhow::{Context, bail};
use randt::{exit::Outcome, input::InputOptions, job, output::print_value, results::Results};
use randt_config::{Config, Loaded, SelectionArguments};
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_messages::{Message, RadarPoints, RadarScan, Trust};
use randt_odometry::Odometry;
use randt_readers::{Event, Options};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `randt-lab register`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The first scan: a polar PNG, or the first scan of any input that `randt run` reads
    #[arg(value_name = "A")]
    first: PathBuf,
    /// The second scan, at most a second later
    #[arg(value_name = "B")]
    second: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    options: InputOptions,
}

/// The result: B's `base_link` in A's, both at the ends of their sweeps, de-skewed by the speed
/// that the pair shows.
#[derive(Debug, Serialize)]
struct Registration {
    x_m: f64,
    y_m: f64,
    yaw_deg: f64,
    /// Of (x, y, yaw) in B's frame; m^2, m rad, rad^2.
    covariance: [[f64; 3]; 3],
    cells: u32,
    inliers: u32,
    trust: &'static str,
    /// Forward m/s, left m/s, yaw rate rad/s at B.
    velocity: [f64; 3],
    stamp_a_ns: i64,
    stamp_b_ns: i64,
}

/// Registers and prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let options = arguments.options.options();
    let (first, config) = first_scan(&arguments.first, &options, &arguments.selection)?;
    let (second, _) = first_scan(&arguments.second, &options, &arguments.selection)?;
    let gap_s = (second.head.sweep.end_ns - first.head.sweep.end_ns) as f64 * 1e-9;
    if gap_s <= 0.0 || gap_s > config.odometry.gap_max_s {
        bail!(
            "{} ends {gap_s:.3} s after {}: scans can be registered from 0 to {} s apart (odometry.gap_max_s)",
            arguments.second.display(),
            arguments.first.display(),
            config.odometry.gap_max_s
        );
    }
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(&config, false);
    let mut results = Results::default();
    for scan in [&first, &second] {
        filter.process(scan.as_ref(), &mut points);
        odometry.push_points(points.as_ref(), &mut results);
    }
    odometry.finish(&mut results);
    let [a, b] = results.states.as_slice() else {
        bail!(
            "{}: too few returns to register to",
            arguments.first.display()
        );
    };
    let relative = Pose2::from_array(a.pose).between(&Pose2::from_array(b.pose));
    let c = b.covariance;
    let registration = Registration {
        x_m: relative.x_m,
        y_m: relative.y_m,
        yaw_deg: relative.yaw_rad.to_degrees(),
        covariance: [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [c[6], c[7], c[8]]],
        cells: b.cells,
        inliers: b.inliers,
        trust: if b.trust() == Trust::Good {
            "good"
        } else {
            "degraded"
        },
        velocity: b.velocity,
        stamp_a_ns: a.header.stamp_ns,
        stamp_b_ns: b.header.stamp_ns,
    };
    print_value(arguments.json, &registration, || text(&registration))?;
    Ok(Outcome::Good)
}

fn text(r: &Registration) -> String {
    let sigma = |i: usize| {
        r.covariance
            .get(i)
            .and_then(|row| row.get(i))
            .map_or(0.0, |v| v.sqrt())
    };
    format!(
        "B in A: x {:.3} m (sigma {:.3}), y {:.3} m ({:.3}), yaw {:.3} deg ({:.3})\n\
         {} of {} cells agree, trust {}\n",
        r.x_m,
        sigma(0),
        r.y_m,
        sigma(1),
        r.yaw_deg,
        sigma(2).to_degrees(),
        r.inliers,
        r.cells,
        r.trust
    )
}

/// The first scan of an input, and the configuration for its sensor.
fn first_scan(
    path: &Path,
    options: &Options,
    selection: &SelectionArguments,
) -> anyhow::Result<(Message<RadarScan>, Config)> {
    let mut source = randt_readers::open(path, options)?;
    let loaded: Loaded = selection.load(source.info().sensor.name())?;
    let config = job::fit_input(loaded, source.as_mut())?.config;
    while let Some(event) = source.next_event()? {
        if let Event::Scan(scan) = event {
            return Ok((scan, config));
        }
    }
    let first = source
        .counters()
        .into_iter()
        .map(|c| c.first)
        .find(|first| !first.is_empty());
    Err(anyhow::anyhow!(
        "{}",
        first.unwrap_or_else(|| "no scan in it".to_owned())
    ))
    .with_context(|| path.display().to_string())
}
