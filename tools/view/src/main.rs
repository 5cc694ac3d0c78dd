//! `randt-view`: the live pipeline for Foxglove and Lichtblick, as a process.

mod inputs;

use clap::Parser;
use inputs::Inputs;
use randt_stage::{Descriptor, StageArguments, Waitable, WakeReason, ended, lower_priority, parse};
use randt_view::{AccessPolicy, Board, Server, ViewerLimits, check_address};
use std::error::Error;
use std::process::ExitCode;

/// The view stage: pose, returns, map and their quality, live, for Foxglove and Lichtblick.
///
/// Viewers connect to ws://127.0.0.1:8765 and see recent data: on a slow link less often, never
/// data of minutes ago. It only reads the bus; nothing waits for it.
#[derive(Debug, Parser)]
#[command(name = "randt-view", max_term_width = 100)]
struct Arguments {
    /// Address with port for viewers, instead of view.listen
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = check_address)]
    listen: Option<String>,
    #[command(flatten)]
    stage: StageArguments,
}

fn main() -> ExitCode {
    ended("view", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let loaded = arguments.stage.selection.load(None)?;
    let config = loaded.config;
    check_address(&config.view.listen).map_err(|expected| {
        let (key, found) = (("view", "listen"), &config.view.listen);
        randt_config::Error::value(&loaded.origins, key, found, expected.to_owned())
    })?;
    let view = &config.view;
    let policy = AccessPolicy::new(&view.origins, &view.host_names);
    let limits = ViewerLimits {
        total: view.clients_max as usize,
        per_address: view.clients_max_per_address as usize,
    };
    let listen = arguments.listen.as_ref().unwrap_or(&view.listen).clone();
    lower_priority();
    let mut stage = arguments.stage.open("view")?;
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["robot", "view"], None);
    let clock = stage.clock();
    let mut inputs = Inputs::open(&mut stage)?;
    let mut board = Board::new(&config);
    let mut server = Server::new(&listen, policy, limits, stage.epoch());
    stage.running()?;
    loop {
        inputs.drain(&mut board)?;
        let now_ns = clock.now_ns();
        server.turn(&board, now_ns, &mut |line| stage.log_info(line));
        stage.set_status(server.fault(), 0);
        stage.set_remark(&server.status_remark(now_ns));
        let sockets = server.descriptors().map(Descriptor::new);
        let sockets = sockets.collect::<Result<Vec<_>, _>>()?;
        let mut on = inputs.waitables();
        on.extend(sockets.iter().map(|socket| socket as &dyn Waitable));
        if stage.wait(&on, Some(server.pause()))? == WakeReason::Stop {
            break;
        }
    }
    Ok(stage.close()?)
}
