//! What a stage owes whoever has started it: readiness, words, signs of life, and the configuration read again.

use crate::{
    Error,
    health::Condition,
    notify::Notify,
    ports::PortCounters,
    reload::{Asked, Changes, Followed, Requests},
    status::Pulse,
    wait::Descriptor,
};
use randt_config::{Config, SelectionArguments};
use randt_messages::StageState;
use std::rc::Rc;

/// The stage's side towards systemd; does nothing where nobody listens.
#[derive(Debug)]
pub(crate) struct Supervised {
    notify: Notify,
    /// Under systemd only: elsewhere SIGHUP says that the terminal has gone, and ends the stage.
    requests: Option<Requests>,
    followed: Option<Followed>,
    pulse: Pulse,
    note: String,
}

impl Supervised {
    /// As the environment says. Call it before the process has a second thread.
    pub(crate) fn begin() -> Result<Self, Error> {
        let notify = Notify::from_environment();
        let requests = notify.is_heard().then(Requests::new).transpose()?;
        Ok(Self {
            notify,
            requests,
            followed: None,
            pulse: Pulse::default(),
            note: String::new(),
        })
    }

    /// What the stage adds to its status.
    pub(crate) fn set_note(&mut self, note: &str) {
        if self.note != note {
            note.clone_into(&mut self.note);
        }
    }

    /// How the configuration is read again.
    pub(crate) fn follow(
        &mut self,
        selection: &SelectionArguments,
        config: &Config,
        reads: &[&'static str],
        live: Option<&'static str>,
    ) {
        if self.requests.is_some() {
            self.followed = Some(Followed::new(selection, config, reads, live));
        }
    }

    /// The loop works; gives when it has to say so again, ns.
    pub(crate) fn works(&mut self, now_ns: i64) -> i64 {
        self.notify.works(now_ns)
    }

    /// Tells how the stage is.
    pub(crate) fn publish_status(
        &mut self,
        now_ns: i64,
        condition: &Condition,
        ports: &[Rc<PortCounters>],
    ) {
        if !self.notify.is_heard() {
            return;
        }
        match condition.state {
            StageState::Starting => {}
            StageState::Stopping => self.notify.stopping(),
            StageState::Running | StageState::Degraded | StageState::Finished => {
                let ports: Vec<_> = ports.iter().map(|port| port.health()).collect();
                let message = &condition.message;
                let (words, is_fresh) = self.pulse.words(now_ns, &ports, &self.note, message);
                self.notify.ready(now_ns, &words, is_fresh);
            }
        }
    }

    /// What else to sleep on.
    pub(crate) fn descriptor(&self) -> Result<Option<Descriptor<'_>>, Error> {
        self.requests.as_ref().map(Requests::descriptor).transpose()
    }

    /// What was asked for since the last look.
    pub(crate) fn asked(&self) -> Option<Asked> {
        self.requests.as_ref()?.take()
    }

    /// The configuration read again.
    pub(crate) fn read_again(&mut self, stage: &str) -> Result<Changes, randt_config::Error> {
        self.notify.reloading();
        let followed = self.followed.as_mut();
        followed.map_or_else(|| Ok(Changes::default()), |it| it.read_again(stage))
    }
}
