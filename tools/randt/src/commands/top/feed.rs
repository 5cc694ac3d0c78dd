//! A topic that is read as long as a stage has it open.

use randt_messages::{MessageRef, Topic};
use randt_stage::{Entry, Observer, Subscriber};
use std::time::{Duration, Instant};

/// What could not be opened is tried again after this time: trying holds up those who start.
const AGAIN: Duration = Duration::from_secs(5);

/// A topic that may come and go.
pub struct Feed<T: Topic> {
    subscriber: Option<Subscriber<T>>,
    trouble: Option<String>,
    tried: Option<Instant>,
}

impl<T: Topic> Default for Feed<T> {
    fn default() -> Self {
        Self {
            subscriber: None,
            trouble: None,
            tried: None,
        }
    }
}

impl<T: Topic> Feed<T> {
    /// Opens the topic when a stage has it, and leaves it when none has any more, so that one of
    /// another build may have it then.
    pub fn follow(&mut self, observer: &Observer, living: &[Entry]) {
        let mut entries = living.iter();
        let found = entries.find_map(|entry| Some((entry, entry.topics.get(T::NAME)?)));
        let Some((entry, layout)) = found else {
            *self = Self::default();
            return;
        };
        if layout != T::TYPE_NAME {
            let trouble = format!(
                "{} is not read: randt-{} (process {}) has the layout {layout}, this randt {}; use the one of its build",
                T::NAME,
                entry.name,
                entry.pid,
                T::TYPE_NAME
            );
            *self = Self::default();
            self.trouble = Some(trouble);
            return;
        }
        let rests = self.tried.is_some_and(|tried| tried.elapsed() < AGAIN);
        if self.subscriber.is_none() && !rests {
            match observer.subscriber() {
                Ok(subscriber) => {
                    *self = Self::default();
                    self.subscriber = Some(subscriber);
                }
                Err(error) => {
                    self.trouble = Some(format!("{} is not read: {error}", T::NAME));
                    self.tried = Some(Instant::now());
                }
            }
        }
    }

    /// Takes what has come.
    pub fn read(&mut self, observer: &Observer, each: impl FnMut(MessageRef<'_, T>)) {
        let Some(subscriber) = &mut self.subscriber else {
            return;
        };
        if let Err(error) = observer.read(subscriber, each) {
            self.trouble = Some(error.to_string());
        }
    }

    /// Why it is not read.
    pub fn trouble(&self) -> Option<&String> {
        self.trouble.as_ref()
    }
}
