//! What a stage owes the supervisor that has started it: readiness, status, the watchdog's signal,
//! lines for the journal, and the configuration read again.

mod data_flow;
mod exit;
mod journal;
mod notify;
mod parent;
mod priority;
mod reload;
mod requests;
mod status;

pub use exit::ended;
pub(crate) use journal::{LastMessage, Priority};
pub use parent::end_with;
pub use priority::lower_priority;
pub(crate) use reload::FollowedConfiguration;
pub(crate) use requests::Request;
pub(crate) use status::StageStatus;

use crate::{Error, ports::Descriptor};
use data_flow::DataFlow;
use journal::Journal;
use notify::Notify;
use randt_config::Config;
use randt_messages::{PortHealth, StageState};
use requests::Requests;

/// The stage's side towards systemd and journald; does nothing where neither is there.
#[derive(Debug)]
pub(crate) struct Supervision {
    pub notify: Notify,
    /// Under systemd only: elsewhere SIGHUP says that the terminal has gone, and ends the stage.
    requests: Option<Requests>,
    configuration: Option<FollowedConfiguration>,
    data_flow: DataFlow,
    /// What the stage adds to its status.
    pub note: String,
    pub journal: Journal,
}

impl Supervision {
    /// As the environment says. Call it before the process has a second thread.
    pub(crate) fn begin(stage: &str) -> Result<Self, Error> {
        let notify = Notify::from_environment();
        let requests = notify.has_listener().then(Requests::new).transpose()?;
        Ok(Self {
            notify,
            requests,
            configuration: None,
            data_flow: DataFlow::default(),
            note: String::new(),
            journal: Journal::open(stage),
        })
    }

    /// See [`crate::Stage::follow_configuration`].
    pub(crate) fn follow(&mut self, configuration: FollowedConfiguration) {
        self.configuration = Some(configuration).filter(|_| self.requests.is_some());
    }

    /// Sends the status to systemd.
    pub(crate) fn publish_status(
        &mut self,
        now_ns: i64,
        status: &StageStatus,
        ports: &[PortHealth],
    ) {
        if !self.notify.has_listener() {
            return;
        }
        match status.state {
            StageState::Starting => {}
            StageState::Stopping => self.notify.stopping(),
            StageState::Running | StageState::Degraded | StageState::Finished => {
                let flow = &mut self.data_flow;
                let (text, is_fresh) = flow.describe(now_ns, ports, &self.note, &status.message);
                self.notify.ready(now_ns, &text, is_fresh);
            }
        }
    }

    /// What else to sleep on.
    pub(crate) fn descriptor(&self) -> Result<Option<Descriptor<'_>>, Error> {
        self.requests.as_ref().map(Requests::descriptor).transpose()
    }

    /// What was requested since the last call.
    pub(crate) fn take_request(&self) -> Option<Request> {
        self.requests.as_ref()?.take()
    }

    /// Reads the configuration again; returns what is to be logged, line by line.
    pub(crate) fn read_configuration(
        &mut self,
        stage: &str,
    ) -> Result<Vec<String>, randt_config::Error> {
        self.notify.reloading();
        let followed = self.configuration.as_mut();
        followed.map_or_else(|| Ok(Vec::new()), |followed| followed.read_again(stage))
    }

    /// Whether a configuration waits to be taken over.
    pub(crate) fn has_changed(&self) -> bool {
        let followed = self.configuration.as_ref();
        followed.is_some_and(|followed| followed.changed.is_some())
    }

    /// A configuration to take over, once.
    pub(crate) fn take_changed(&mut self) -> Option<Config> {
        self.configuration.as_mut()?.changed.take()
    }
}
