//! `randt inspect`: what an input holds, what of it will be used and why, what is missing or odd,
//! and the command that computes it.

mod doubts;
mod journal;
mod picture;
mod survey;

use crate::exit::Outcome;
use crate::input::InputOptions;
use crate::job;
use crate::journal_input::journal_of;
use crate::output::{print_value, warn, write_whole};
use crate::units::count;
use anyhow::ensure;
use doubts::doubts;
use randt_config::{Config, SelectionArguments};
use randt_readers::{InputInfo, Options, Source};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use survey::Survey;

/// Arguments of `randt inspect`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Anything that `randt run` takes: a file, a folder, a mission
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Picture of three scans; if not given, named after the input, in this folder
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    options: InputOptions,
}

/// What was found. The fields are the keys of the JSON object.
#[derive(Debug, Serialize)]
struct Inspection {
    input: String,
    format: &'static str,
    sensor: Option<&'static str>,
    /// Width of a range bin, m, and bins of polar images.
    range_resolution_m: Option<f64>,
    bins: Option<usize>,
    topics: Vec<TopicRow>,
    #[serde(flatten)]
    survey: Survey,
    /// x m, y m, yaw rad of the radar in `base_link`.
    radar_mounting: Option<[f64; 3]>,
    /// What the reader dropped, repaired or assumed.
    counters: Vec<CounterRow>,
    doubts: Vec<String>,
    picture: Option<String>,
    command: String,
}

/// A topic of the input.
#[derive(Debug, Serialize)]
struct TopicRow {
    topic: String,
    type_name: String,
    messages: u64,
    used_as: Option<&'static str>,
}

/// A counter of the reader.
#[derive(Debug, Serialize)]
struct CounterRow {
    name: String,
    count: u64,
    loss: bool,
    first: String,
}

/// Reads the input through and prints. Ends with "failed" where it holds no sweep.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    job::catch_interrupts();
    if let Some(found) = journal_of(&arguments.input) {
        return journal::run(&arguments.input, &found, arguments.json);
    }
    let mut options: Options = arguments.options.options();
    options.radar_required = false;
    let mut source = randt_readers::open(&arguments.input, &options)?;
    let info = source.info().clone();
    let loaded =
        (arguments.selection).load_recorded(info.sensor.name(), info.configuration.clone())?;
    let bins = info.bin_size.map(|bins| bins.bins);
    // A picture needs some size; the doubts name what is missing.
    let (config, needs_size) = match job::fit_input(loaded, source.as_mut()) {
        Ok(loaded) => (Some(loaded.config), false),
        Err(randt_config::Error::BinSizeUnknown { .. }) => (None, true),
        Err(error) => return Err(error.into()),
    };
    if needs_size {
        source.set_bin_size(survey::SIZE_ASSUMED_M);
    }
    let survey = Survey::read(source.as_mut())?;
    let sensor = survey.other_sensor(&arguments.selection, &info, config.as_ref());
    let config = match sensor {
        Some(_) => Some(arguments.selection.load_recorded(sensor, None)?.config),
        None => config,
    };
    let file = arguments.picture.clone().unwrap_or_else(|| {
        let name = arguments.input.file_name().unwrap_or_default();
        PathBuf::from(format!("{}.scans.svg", name.to_string_lossy()))
    });
    let picture = match survey.sketches.is_empty() {
        true => None,
        false => match write_whole(&file, picture::draw(&survey, needs_size).as_bytes()) {
            Ok(()) => Some(file.display().to_string()),
            // Nobody asked for it: what is in the input is said all the same.
            Err(error) if arguments.picture.is_none() => {
                warn(&format!("no picture: {error:#}"));
                None
            }
            Err(error) => return Err(error),
        },
    };
    let found = Inspection {
        input: arguments.input.display().to_string(),
        format: info.format,
        sensor: info.sensor.name(),
        range_resolution_m: (!needs_size).then_some(survey.range_resolution_m).flatten(),
        bins,
        topics: topics(&info),
        radar_mounting: info.extrinsics.radar.map(|pose| pose.to_array()),
        doubts: doubts(&info, &survey, needs_size),
        command: command(&arguments, &info, &survey, (sensor, config)),
        counters: counters(source.as_ref()),
        picture,
        survey,
    };
    print_value(arguments.json, &found, || table(&found))?;
    Ok(match found.survey.sweeps {
        0 => Outcome::Failed,
        _ => Outcome::finished(found.counters.iter().any(|counter| counter.loss)),
    })
}

fn topics(info: &InputInfo) -> Vec<TopicRow> {
    let topics = info.topics.iter();
    let row = |topic: &randt_readers::InputTopic| TopicRow {
        topic: topic.name.clone(),
        type_name: topic.type_name.clone(),
        messages: topic.messages,
        used_as: topic.used_as,
    };
    topics.map(row).collect()
}

fn counters(source: &dyn Source) -> Vec<CounterRow> {
    let counters = source.counters().into_iter();
    let row = |counter: randt_readers::Counter| CounterRow {
        name: counter.name.to_owned(),
        count: counter.count,
        loss: counter.loss,
        first: counter.first,
    };
    counters.map(row).collect()
}

/// An argument as a shell takes it.
fn quoted(text: String) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=,@".contains(c);
    match text.chars().all(is_plain) {
        true => text,
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

/// The command that computes the input, with what the user has said here.
fn command(
    arguments: &Arguments,
    info: &InputInfo,
    survey: &Survey,
    (sensor, config): (Option<&str>, Option<Config>),
) -> String {
    let mut command = format!(
        "randt run {} --out RESULTS",
        quoted(arguments.input.display().to_string())
    );
    let chosen = arguments.selection.as_arguments();
    if !chosen.iter().any(|option| option.starts_with("--profile")) && info.configuration.is_none()
    {
        command += survey.profile();
    }
    if let Some(sensor) = sensor {
        command += &format!(" --sensor {sensor}");
    }
    for option in chosen.into_iter().chain(arguments.options.given()) {
        command += &format!(" {}", quoted(option));
    }
    match config {
        Some(config) => survey.settings(config).for_each(|setting| {
            command += &format!(" --set {setting}");
        }),
        None => command += " --set sensor.range_resolution_m=WIDTH_OF_A_BIN_IN_M",
    }
    command
}

/// The same for people.
fn table(found: &Inspection) -> String {
    let mut text = String::new();
    let survey = &found.survey;
    let sensor = found.sensor.unwrap_or("radar of no known model");
    let mut line = |name: &str, words: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<10} {words}");
    };
    line(
        "input",
        format!("{}: {}, {sensor}", found.input, found.format),
    );
    for row in &found.topics {
        let used = row
            .used_as
            .map_or("not used".to_owned(), |role| format!("used: {role}"));
        let messages = count(row.messages, "message", "messages");
        line(
            "topic",
            format!("{} ({}), {messages}, {used}", row.topic, row.type_name),
        );
    }
    if survey.sweeps > 0 {
        line(
            "radar",
            survey.radar_text(found.range_resolution_m, found.bins),
        );
    }
    line("imu", survey.imu_text());
    if survey.truths > 0 {
        line("truth", count(survey.truths, "true pose", "true poses"));
    }
    match found.radar_mounting {
        Some([x, y, yaw]) => line(
            "mounting",
            format!(
                "radar at x {x:.2} m, y {y:.2} m, yaw {:.1} deg in base_link",
                yaw.to_degrees()
            ),
        ),
        None => line(
            "mounting",
            "not in the input: base_link is the radar".to_owned(),
        ),
    }
    for counter in &found.counters {
        let kind = if counter.loss { "lost" } else { "note" };
        line(
            kind,
            format!("{} {}: {}", counter.count, counter.name, counter.first),
        );
    }
    for doubt in &found.doubts {
        line("doubt", doubt.clone());
    }
    if let Some(picture) = &found.picture {
        line("picture", format!("{picture} (three scans)"));
    }
    line("run", found.command.clone());
    text
}

/// Keeps reading within Ctrl-C's reach.
fn check_interrupt() -> anyhow::Result<()> {
    ensure!(!job::interrupted(), "interrupted");
    Ok(())
}
