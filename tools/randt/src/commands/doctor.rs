//! `randt doctor`: what is wrong with a pipeline, and what mends it.

mod clean;
mod clock;
mod exposed;
mod finding;
mod leftovers;
mod memory;
mod owner;
mod processes;
mod scene;
mod sensors;
mod shared_memory;
mod slots;
mod stages;
mod worlds;

use crate::{exit::Outcome, identity::Identity, output::print};
use finding::{Finding, Grade};
use randt_stage::{Domain, DomainArguments};
use scene::Scene;

/// Arguments of `randt doctor`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    part: Option<Part>,
    /// Remove what dead stages left behind; while others live, only what nobody living holds
    #[arg(long)]
    clean: bool,
    /// With --clean: also what stages would go on from (checkpoints, the last keyframes, counts of starts)
    #[arg(long, requires = "clean")]
    state: bool,
    #[command(flatten)]
    domain: DomainArguments,
}

/// What else there is to examine.
#[derive(Debug, clap::Subcommand)]
enum Part {
    /// Radar and IMU: reached, rate, stamps, gravity, sense of rotation
    Sensors(sensors::Arguments),
}

/// Examines or cleans. Ends with "failed" where something is bad.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    if let Some(Part::Sensors(arguments)) = arguments.part {
        return sensors::run(&arguments);
    }
    let domain = arguments.domain.domain()?;
    if let Some(finding) = owner::open_to_all(&domain) {
        // Nothing in it is opened: anybody may have made it.
        return conclude(&title(&domain), &[finding]);
    }
    // Root's looks and cleans with the rights of the domain's owner, who may have put links in it.
    let owner = Identity::of_way_to(&domain.folder())?;
    owner.run(|| examine(domain, &arguments))
}

fn examine(domain: Domain, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scene = Scene::of(domain);
    if arguments.clean {
        return clean::run(&scene, arguments.state);
    }
    let mut findings = vec![owner::check(&scene), owner::check_rights(&scene)];
    findings.push(exposed::check(&scene));
    findings.push(worlds::check(&scene, arguments.domain.run.is_none()));
    findings.push(memory::check(&scene));
    findings.push(memory::check_run_folder(&scene));
    findings.push(clock::check(&scene));
    findings.push(stages::check(&scene));
    findings.push(stages::check_builds(&scene));
    findings.push(shared_memory::check(&scene));
    findings.push(slots::check(&scene));
    findings.push(leftovers::check(&scene));
    conclude(&title(&scene.domain), &findings.concat())
}

fn title(domain: &Domain) -> String {
    format!("domain {} in {}", domain.prefix(), domain.run().display())
}

/// Prints what was found.
fn conclude(title: &str, findings: &[Finding]) -> anyhow::Result<Outcome> {
    let lines: String = findings.iter().map(ToString::to_string).collect();
    print(&format!("{title}\n{lines}"))?;
    let bad = findings.iter().any(|finding| finding.grade == Grade::Bad);
    Ok(if bad { Outcome::Failed } else { Outcome::Good })
}
