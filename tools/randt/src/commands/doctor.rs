//! `randt doctor`: what is wrong with a pipeline, and what mends it.

mod clean;
mod clock;
mod finding;
mod leftovers;
mod memory;
mod owner;
mod processes;
mod scene;
mod stages;
mod worlds;

use crate::{exit::Outcome, output::print};
use finding::Grade;
use randt_stage::RealmArguments;
use scene::Scene;

/// Arguments of `randt doctor`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Remove what dead stages left behind; refused while a stage lives
    #[arg(long)]
    clean: bool,
    /// With --clean: also what stages would go on from (checkpoints, the last keyframes, counts of starts)
    #[arg(long, requires = "clean")]
    state: bool,
    #[command(flatten)]
    realm: RealmArguments,
}

/// Examines or cleans. Ends with "failed" where something is bad.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let scene = Scene::of(arguments.realm.realm()?);
    if arguments.clean {
        return clean::run(&scene, arguments.state);
    }
    let mut findings = vec![owner::check(&scene), owner::check_rights(&scene)];
    findings.push(worlds::check(&scene, arguments.realm.run.is_none()));
    findings.push(memory::check(&scene));
    findings.push(memory::check_run_folder(&scene));
    findings.push(clock::check(&scene));
    findings.push(stages::check(&scene));
    findings.push(stages::check_builds(&scene));
    findings.push(leftovers::check(&scene));
    let findings = findings.concat();
    let lines: String = findings.iter().map(ToString::to_string).collect();
    let realm = &scene.realm;
    print(&format!(
        "realm {} in {}\n{lines}",
        realm.prefix(),
        realm.run().display()
    ))?;
    let bad = findings.iter().any(|finding| finding.grade == Grade::Bad);
    Ok(if bad { Outcome::Failed } else { Outcome::Good })
}
