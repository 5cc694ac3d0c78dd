//! The thread that brings messages from the queue to the disk.

use crate::{Positions, Queue, Recorder, Sink, Trouble};
use randt_messages::DropCause;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Looked for messages so often: they come in chunks of half a second anyway.
const PAUSE: Duration = Duration::from_millis(100);
/// Taken out of the queue at once; about a chunk.
const BATCH: usize = 1 << 20;
/// A disk that has not answered for so long is told of.
const SILENCE_MAX: Duration = Duration::from_millis(1500);

/// What the thread says of itself.
#[derive(Clone, Debug, Default)]
pub struct Condition {
    /// Why nothing is recorded; empty where all is well.
    pub trouble: String,
    /// The file that is being written.
    pub file: String,
    /// Messages that were recorded and are lost.
    pub lost: u64,
}

/// The running thread.
#[derive(Debug)]
pub struct Worker {
    queue: Arc<Queue>,
    shared: Arc<Mutex<Shared>>,
    thread: Option<JoinHandle<u64>>,
}

#[derive(Debug)]
struct Shared {
    condition: Condition,
    seen: Instant,
}

impl Worker {
    /// Starts the thread; `now_ns` is the pipeline's clock. `keep` is given how far the files reach, whenever they have
    /// grown.
    pub fn start<S: Sink + Send + 'static>(
        queue: Arc<Queue>,
        recorder: Recorder<S>,
        now_ns: impl Fn() -> i64 + Send + 'static,
        keep: impl FnMut(&Positions) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Mutex::new(Shared {
            condition: Condition::default(),
            seen: Instant::now(),
        }));
        let (from, to) = (Arc::clone(&queue), Arc::clone(&shared));
        let thread = std::thread::spawn(move || work(&from, recorder, &to, now_ns, keep));
        Self {
            queue,
            shared,
            thread: Some(thread),
        }
    }

    /// How it is.
    pub fn condition(&self) -> Condition {
        let shared = lock(&self.shared);
        let mut condition = shared.condition.clone();
        let silent = shared.seen.elapsed();
        if condition.trouble.is_empty() && silent > SILENCE_MAX {
            // In doublings: each text that is new is a line in the journal.
            let mut said = SILENCE_MAX;
            while 2 * said <= silent {
                said *= 2;
            }
            let seconds = said.as_secs_f64();
            condition.trouble = format!("the disk has not answered for over {seconds} s");
        }
        condition
    }

    /// Whether it has ended by itself, which it never should.
    pub fn has_died(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Brings all that waits to the disk and ends the file; gives how many messages no file has, those in
    /// files that vanished among them.
    pub fn finish(mut self) -> u64 {
        self.queue.close();
        let left = self.thread.take().map(JoinHandle::join);
        // A thread that panicked has said so itself, and left what it had not taken.
        left.and_then(Result::ok)
            .unwrap_or_else(|| self.queue.waiting())
    }
}

fn lock(shared: &Mutex<Shared>) -> std::sync::MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn work<S: Sink>(
    queue: &Queue,
    mut recorder: Recorder<S>,
    shared: &Mutex<Shared>,
    now_ns: impl Fn() -> i64,
    mut keep: impl FnMut(&Positions),
) -> u64 {
    loop {
        let closed = queue.closes_within(PAUSE);
        recorder.tick(now_ns());
        while recorder.is_recording() {
            let drops = queue.take_drops();
            let messages = queue.take(BATCH);
            if messages.is_empty() && drops.is_empty() {
                break;
            }
            recorder.push_drops(&drops, now_ns());
            for raw in messages {
                recorder.push(raw, now_ns());
                keep(recorder.positions());
            }
            recorder.tick(now_ns());
            keep(recorder.positions());
            tell(&recorder, queue, shared);
        }
        keep(recorder.positions());
        tell(&recorder, queue, shared);
        if closed {
            recorder.finish(now_ns());
            keep(recorder.positions());
            tell(&recorder, queue, shared);
            return queue.waiting() + recorder.unsaved() + recorder.lost();
        }
    }
}

fn tell<S: Sink>(recorder: &Recorder<S>, queue: &Queue, shared: &Mutex<Shared>) {
    let trouble = recorder.trouble();
    queue.blame(trouble.map_or(DropCause::Slow, |trouble| trouble.cause));
    let text = |trouble: &Trouble| trouble.text.clone();
    let condition = Condition {
        trouble: trouble.map(text).unwrap_or_default(),
        file: recorder.file().unwrap_or_default().to_owned(),
        lost: recorder.lost(),
    };
    *lock(shared) = Shared {
        condition,
        seen: Instant::now(),
    };
}
