//! The thread that brings messages from the queue to the disk.

use crate::{Outage, Positions, Queue, Recorder, Sink};
use randt_messages::DropCause;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The queue is polled with this period: messages come in chunks of half a second anyway.
const PAUSE: Duration = Duration::from_millis(100);
/// Taken out of the queue at once; about a chunk.
const BATCH: usize = 1 << 20;
/// A disk that has not answered for this time is reported.
const SILENCE_MAX: Duration = Duration::from_millis(1500);

/// The thread's status.
#[derive(Clone, Debug, Default)]
pub struct WorkerStatus {
    /// Why nothing is recorded; empty where all is well.
    pub outage: String,
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
    status: WorkerStatus,
    updated: Instant,
}

impl Worker {
    /// Starts the thread; `now_ns` is the pipeline's clock. `keep` is given how far the files
    /// reach, whenever they have grown.
    pub fn start<S: Sink + Send + 'static>(
        queue: Arc<Queue>,
        recorder: Recorder<S>,
        now_ns: impl Fn() -> i64 + Send + 'static,
        keep: impl FnMut(&Positions) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Mutex::new(Shared {
            status: WorkerStatus::default(),
            updated: Instant::now(),
        }));
        let (from, to) = (Arc::clone(&queue), Arc::clone(&shared));
        let thread = std::thread::spawn(move || work(&from, recorder, &to, now_ns, keep));
        Self {
            queue,
            shared,
            thread: Some(thread),
        }
    }

    /// Its status now.
    pub fn status(&self) -> WorkerStatus {
        let shared = lock(&self.shared);
        let mut status = shared.status.clone();
        let silent = shared.updated.elapsed();
        if status.outage.is_empty() && silent > SILENCE_MAX {
            // In doublings: each text that is new is a line in the journal.
            let mut reported = SILENCE_MAX;
            while 2 * reported <= silent {
                reported *= 2;
            }
            let seconds = reported.as_secs_f64();
            status.outage = format!("the disk has not answered for over {seconds} s");
        }
        status
    }

    /// Whether it has ended by itself, which it never should.
    pub fn has_died(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Brings all that waits to the disk and ends the file; gives how many messages no file has,
    /// those in files that vanished among them.
    pub fn finish(mut self) -> u64 {
        self.queue.close();
        let left = self.thread.take().map(JoinHandle::join);
        // A thread that panicked has printed its message, and left what it had not taken.
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
            publish_status(&recorder, queue, shared);
        }
        keep(recorder.positions());
        publish_status(&recorder, queue, shared);
        if closed {
            recorder.finish(now_ns());
            keep(recorder.positions());
            publish_status(&recorder, queue, shared);
            return queue.waiting() + recorder.unsaved() + recorder.lost();
        }
    }
}

fn publish_status<S: Sink>(recorder: &Recorder<S>, queue: &Queue, shared: &Mutex<Shared>) {
    let outage = recorder.outage();
    queue.set_drop_cause(outage.map_or(DropCause::Slow, |outage| outage.cause));
    let text = |outage: &Outage| outage.text.clone();
    let status = WorkerStatus {
        outage: outage.map(text).unwrap_or_default(),
        file: recorder.file().unwrap_or_default().to_owned(),
        lost: recorder.lost(),
    };
    *lock(shared) = Shared {
        status,
        updated: Instant::now(),
    };
}
