//! `randt doctor`: what is wrong with a pipeline, and what fixes it.

mod clean;
mod clock;
mod exposed;
mod finding;
mod isolation;
mod leftovers;
mod memory;
mod owner;
mod processes;
mod sensors;
mod shared_memory;
mod slots;
mod snapshot;
mod stages;

use crate::{exit::Outcome, identity::Identity, output::print_value};
use finding::{Finding, Grade};
use randt_stage::{Domain, DomainArguments};
use serde_json::json;
use snapshot::DomainSnapshot;

/// Arguments of `randt doctor`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    subject: Option<Subject>,
    /// Remove what dead stages left behind; while others live, only what nobody living holds
    #[arg(long)]
    clean: bool,
    /// With --clean: also what stages would go on from (checkpoints, the last keyframes, counts of
    /// starts)
    #[arg(long, requires = "clean")]
    state: bool,
    /// As JSON
    #[arg(long, conflicts_with = "clean")]
    json: bool,
    #[command(flatten)]
    domain: DomainArguments,
}

/// What else there is to examine.
#[derive(Debug, clap::Subcommand)]
enum Subject {
    /// Radar and IMU: reached, rate, stamps, gravity, rates that lie, whether radar and gyro agree
    Sensors(sensors::Arguments),
}

/// Examines or cleans. Ends with "failed" where something is bad.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    if let Some(Subject::Sensors(arguments)) = arguments.subject {
        return sensors::run(&arguments);
    }
    let domain = arguments.domain.domain()?;
    if let Some(finding) = owner::open_to_all(&domain) {
        // Nothing in it is opened: anybody may have made it.
        return print_findings(arguments.json, &title(&domain), &[finding]);
    }
    // Root's process reads and cleans with the rights of the domain's owner, who may have put
    // links in it.
    let owner = Identity::of_way_to(&domain.folder())?;
    owner.run(|| examine(domain, &arguments))
}

fn examine(domain: Domain, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let snapshot = DomainSnapshot::take(domain);
    if arguments.clean {
        return clean::run(&snapshot, arguments.state);
    }
    let mut findings = vec![owner::check(&snapshot), owner::check_rights(&snapshot)];
    findings.push(exposed::check(&snapshot));
    findings.push(isolation::check(&snapshot, arguments.domain.run.is_none()));
    findings.push(memory::check(&snapshot));
    findings.push(memory::check_run_folder(&snapshot));
    findings.push(clock::check(&snapshot));
    findings.push(stages::check(&snapshot));
    findings.push(stages::check_builds(&snapshot));
    findings.push(shared_memory::check(&snapshot));
    findings.push(slots::check(&snapshot));
    findings.push(leftovers::check(&snapshot));
    print_findings(arguments.json, &title(&snapshot.domain), &findings.concat())
}

fn title(domain: &Domain) -> String {
    format!("domain {} in {}", domain.prefix(), domain.run().display())
}

/// Prints what was found.
fn print_findings(json: bool, title: &str, findings: &[Finding]) -> anyhow::Result<Outcome> {
    let value = json!({ "about": title, "findings": findings });
    print_value(json, &value, || {
        let lines: String = findings.iter().map(ToString::to_string).collect();
        format!("{title}\n{lines}")
    })?;
    let bad = findings.iter().any(|finding| finding.grade == Grade::Bad);
    Ok(if bad { Outcome::Failed } else { Outcome::Good })
}
