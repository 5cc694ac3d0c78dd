//! Counts what was dropped, repaired or assumed.

use crate::Counter;

/// Counters in the order in which they first counted something.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counters(Vec<Counter>);

impl Counters {
    /// Counts data that are lost. `first` is called only the first time.
    pub fn count_loss(&mut self, name: &'static str, count: u64, first: impl FnOnce() -> String) {
        self.add(name, count, true, first);
    }

    /// Counts something repaired or assumed.
    pub fn count_event(&mut self, name: &'static str, count: u64, first: impl FnOnce() -> String) {
        self.add(name, count, false, first);
    }

    /// Adds those of another input.
    pub fn add_all(&mut self, others: Vec<Counter>) {
        for other in others {
            self.add(other.name, other.count, other.loss, || other.first);
        }
    }

    fn add(&mut self, name: &'static str, count: u64, loss: bool, first: impl FnOnce() -> String) {
        if count == 0 {
            return;
        }
        match self.0.iter_mut().find(|counter| counter.name == name) {
            Some(counter) => counter.count += count,
            None => self.0.push(Counter {
                name,
                count,
                first: first(),
                loss,
            }),
        }
    }

    /// The counters so far.
    pub fn list(&self) -> Vec<Counter> {
        self.0.clone()
    }
}
