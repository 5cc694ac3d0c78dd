//! The thread that waits for the disk: a card that stalls for seconds holds up neither the map nor
//! its watchdog.

use randt_mapper::journal::{Compacted, Compaction, Error, Sync, Synced};
use std::io;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};

/// What it is given to do.
pub enum Job {
    Sync(Sync),
    Compaction(Compaction),
}

/// What it has done.
pub enum Done {
    Synced(Synced),
    Compacted(Result<Compacted, Error>),
}

/// The thread, with one job at a time.
pub struct DiskThread {
    jobs: Option<Sender<Job>>,
    done: Receiver<Done>,
    is_busy: bool,
    thread: Option<JoinHandle<()>>,
}

impl DiskThread {
    /// Begins it.
    pub fn begin() -> io::Result<Self> {
        let (jobs, to_do) = mpsc::channel::<Job>();
        let (sender, done) = mpsc::channel();
        let work = move || {
            for job in to_do {
                let done = match job {
                    Job::Sync(sync) => Done::Synced(sync.run()),
                    Job::Compaction(compaction) => Done::Compacted(compaction.run()),
                };
                if sender.send(done).is_err() {
                    return;
                }
            }
        };
        let thread = thread::Builder::new().name("journal".into()).spawn(work)?;
        Ok(Self {
            jobs: Some(jobs),
            done,
            is_busy: false,
            thread: Some(thread),
        })
    }

    /// Whether it has a job.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Gives it one, when it has none.
    pub fn give(&mut self, job: Job) {
        let given = self
            .jobs
            .as_ref()
            .is_some_and(|jobs| jobs.send(job).is_ok());
        self.is_busy |= given;
    }

    /// What it has done since.
    pub fn poll(&mut self) -> Option<Done> {
        let done = self.done.try_recv().ok();
        self.is_busy &= done.is_none();
        done
    }

    /// The same; waits for it, where it has a job.
    pub fn wait(&mut self) -> Option<Done> {
        let done = self.is_busy.then(|| self.done.recv().ok()).flatten();
        self.is_busy = false;
        done
    }
}

impl Drop for DiskThread {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // It ends with the job that it has; a panic of it is no news any more.
            let _ = thread.join();
        }
    }
}
