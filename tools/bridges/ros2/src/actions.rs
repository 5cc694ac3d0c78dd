//! What the services do: the mission control of the command line, and waiting for the disk.

use crate::node::Node;
use crate::service::Request;
use randt_ros_bridge::Kept;
use std::path::PathBuf;
use std::process::Command;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Names of the services; their indices are those of [`ACTIONS`].
pub const SERVICES: [&str; 3] = ["/randt/new_mission", "/randt/stop_mission", "/randt/save"];
const ACTIONS: [Action; 3] = [Action::New, Action::Stop, Action::Save];
/// The disk of a robot that runs has what the mapper knows within this.
const SAVE_MAX: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    New,
    Stop,
    Save,
}

/// Requests that are not answered yet.
pub struct Actions {
    /// The command `randt` with the pipeline's own options.
    program: PathBuf,
    options: Vec<String>,
    ended: (Sender<Ended>, Receiver<Ended>),
    is_running: bool,
    /// Index, request, keyframes that have to be on the disk, and since when.
    waiting: Vec<(usize, Request, u64, Instant)>,
}

/// A command that has ended: whose it was, whether well, and what it said.
type Ended = (usize, Request, bool, String);

impl Actions {
    /// `options`: those of `randt mission`, behind the action.
    pub fn new(program: PathBuf, options: Vec<String>) -> Self {
        Self {
            program,
            options,
            ended: channel(),
            is_running: false,
            waiting: Vec::new(),
        }
    }

    /// Begins what is asked for, and answers what is done. `kept`: what the mapper has on the disk.
    pub fn tend(&mut self, node: &Node, kept: Option<Kept>) {
        for (index, request) in node.requests() {
            match (ACTIONS.get(index), kept) {
                (Some(Action::Save), Some(kept)) => {
                    let wanted = kept.keyframes;
                    self.waiting.push((index, request, wanted, Instant::now()));
                }
                (Some(Action::Save), None) => {
                    node.reply(index, &request, false, "no mapper has said anything yet");
                }
                (Some(_), _) if self.is_running => {
                    node.reply(index, &request, false, "another request is not done yet");
                }
                (Some(action), _) => self.begin(index, request, *action),
                (None, _) => {}
            }
        }
        while let Ok((index, request, is_good, text)) = self.ended.1.try_recv() {
            self.is_running = false;
            node.reply(index, &request, is_good, &text);
        }
        let on_disk = kept.map_or(0, |kept| kept.on_disk);
        self.waiting.retain(|(index, request, wanted, since)| {
            let is_done = on_disk >= *wanted;
            let is_over = is_done || since.elapsed() > SAVE_MAX;
            if is_over {
                let text = format!(
                    "{} of {wanted} keyframes are on the disk",
                    on_disk.min(*wanted)
                );
                node.reply(*index, request, is_done, &text);
            }
            !is_over
        });
    }

    fn begin(&mut self, index: usize, request: Request, action: Action) {
        let mut command = Command::new(&self.program);
        command.args([
            "mission",
            if action == Action::New { "new" } else { "stop" },
        ]);
        command.args(&self.options);
        let ended = self.ended.0.clone();
        self.is_running = true;
        // It takes seconds, and the watchdog waits for nobody.
        std::thread::spawn(move || {
            let (is_good, text) = match command.output() {
                Ok(output) => {
                    let said = [output.stdout, output.stderr].concat();
                    let said = String::from_utf8_lossy(&said).trim().to_owned();
                    (output.status.success(), said)
                }
                Err(error) => (false, format!("{command:?}: {error}")),
            };
            // The stage may have ended.
            let _ = ended.send((index, request, is_good, text));
        });
    }
}
