//! The node of ROS: a process of Python's, started anew whenever it ends.

use crate::frame::{Decoder, Frame};
use randt_device::Backoff;
use randt_stage::{Descriptor, Error};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

const SCRIPT: &str = include_str!("../randt_ros1.py");
/// A node whose input is closed ends at once; one that does not is killed after this.
const END_MAX: Duration = Duration::from_secs(1);
/// Messages that wait for a node that does not take them: a minute of poses and transforms.
const WAITING_MAX: usize = 1024;
/// Bytes read at a time.
const PIECE: usize = 1 << 16;

/// The node, or the wait for the next one.
pub struct Node {
    python: PathBuf,
    /// Its name and the topics that it subscribes to.
    arguments: Vec<String>,
    running: Option<Running>,
    backoff: Backoff,
    /// The topics that it publishes.
    announced: Vec<Frame>,
    /// What who subscribes late must get, by topic: a new node gets it first.
    latched: BTreeMap<String, Frame>,
    /// Messages that no node took.
    pub unsent: u64,
    /// Why there is no node among the others; `None` where there is.
    pub problem: Option<String>,
}

struct Running {
    child: Child,
    out: ChildStdout,
    outgoing: SyncSender<Vec<u8>>,
    decoder: Decoder,
}

impl Node {
    /// A node of this name that subscribes to topics and publishes others. A name has letters,
    /// digits and `_`.
    pub fn new(python: PathBuf, name: &str, topics: Vec<String>, announced: Vec<Frame>) -> Self {
        let name = name.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        let mut arguments = vec![name];
        arguments.extend(topics);
        Self {
            python,
            arguments,
            announced,
            running: None,
            backoff: Backoff::default(),
            latched: BTreeMap::new(),
            unsent: 0,
            problem: None,
        }
    }

    /// Starts a node where there is none and it is time.
    pub fn tend(&mut self, now_ns: i64) {
        if self.running.is_some() || !self.backoff.is_due(now_ns) {
            return;
        }
        // It is there when it says so.
        self.backoff.failed(now_ns);
        match self.start() {
            Ok(running) => {
                self.running = Some(running);
                let master = std::env::var("ROS_MASTER_URI");
                let master = master.unwrap_or_else(|_| "http://localhost:11311".to_owned());
                self.problem = Some(format!(
                    "no node of ROS yet: is the master at {master} there, and rospy?"
                ));
                let announced = self.announced.iter().chain(self.latched.values());
                for frame in announced.cloned().collect::<Vec<_>>() {
                    self.send(frame);
                }
            }
            Err(error) => {
                self.problem = Some(format!("{}: {error}", self.python.display()));
            }
        }
    }

    fn start(&self) -> std::io::Result<Running> {
        let mut command = Command::new(&self.python);
        command.arg("-c").arg(SCRIPT).args(&self.arguments);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (mut stdin, out) = pipes.ok_or(ErrorKind::BrokenPipe)?;
        fcntl_setfl(&out, fcntl_getfl(&out)? | OFlags::NONBLOCK)?;
        let (outgoing, waiting) = sync_channel::<Vec<u8>>(WAITING_MAX);
        // A node that does not read holds up this thread only.
        std::thread::spawn(move || {
            while let Ok(bytes) = waiting.recv() {
                if stdin.write_all(&bytes).is_err() {
                    break;
                }
            }
        });
        Ok(Running {
            child,
            out,
            outgoing,
            decoder: Decoder::default(),
        })
    }

    /// What to wait for.
    pub fn descriptor(&self) -> Result<Option<Descriptor<'_>>, Error> {
        let running = self.running.as_ref();
        running
            .map(|running| Descriptor::new(running.out.as_fd()))
            .transpose()
    }

    /// The messages that have come.
    pub fn received(&mut self) -> Vec<Frame> {
        let mut frames = Vec::new();
        let Some(running) = &mut self.running else {
            return frames;
        };
        let mut piece = vec![0; PIECE];
        loop {
            match running.out.read(&mut piece) {
                Ok(0) => break,
                Ok(count) => running.decoder.push(piece.get(..count).unwrap_or_default()),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return frames,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => break,
            }
            loop {
                match running.decoder.next_frame() {
                    Ok(Some(frame)) if frame.is_announcement => {
                        self.backoff.succeeded();
                        self.problem = None;
                    }
                    Ok(Some(frame)) => frames.push(frame),
                    Ok(None) => break,
                    Err(_) => {
                        self.stop();
                        return frames;
                    }
                }
            }
        }
        // It has ended, or will.
        self.stop();
        frames
    }

    /// Publishes a message.
    pub fn send(&mut self, frame: Frame) {
        let bytes = frame.to_bytes();
        if frame.is_latched && !frame.is_announcement {
            self.latched.insert(frame.topic.clone(), frame);
        }
        // Without a node nobody misses it: nodes that come later begin with what is latched.
        let Some(running) = &self.running else {
            return;
        };
        match running.outgoing.try_send(bytes) {
            Ok(()) => {}
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => self.unsent += 1,
        }
    }

    /// Ends the node.
    pub fn stop(&mut self) {
        let Some(Running {
            mut child,
            outgoing,
            ..
        }) = self.running.take()
        else {
            return;
        };
        // Its input is closed by that.
        drop(outgoing);
        let until = Instant::now() + END_MAX;
        while Instant::now() < until {
            if !matches!(child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        // It hangs: nothing that it could still do is missed.
        let _ = child.kill();
        let _ = child.wait();
    }
}
