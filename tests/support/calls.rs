//! What a process hands to the system in write and send calls, seen from outside with strace.
//!
//! The system's own count of written bytes leaves out what is sent through sockets, and has no
//! count of that. Notices between stages are such sends.

use super::stages::Running;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const CALLS: &str =
    "trace=write,writev,pwrite64,pwritev,pwritev2,sendto,sendmsg,sendmmsg,sendfile,splice,vmsplice";

/// Rates of a process.
#[derive(Clone, Copy, Debug, Default)]
pub struct Calls {
    pub writes_s: f64,
    pub written_kb_s: f64,
    pub sends_s: f64,
    pub sent_kb_s: f64,
}

/// Watches a process for a while; `None` where strace is not there.
pub fn watch(running: &Running, span: Duration) -> Option<Calls> {
    let trace = tempfile::NamedTempFile::new().unwrap();
    let mut strace = Command::new("strace")
        .args(["-f", "-q", "-e", CALLS, "-e", "signal=none", "-o"])
        .arg(trace.path())
        .args(["-p", &running.pid().to_string()])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let begin = Instant::now();
    std::thread::sleep(span);
    // It lets go of the process on SIGINT.
    let pid = rustix::process::Pid::from_raw(strace.id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    let seconds = begin.elapsed().as_secs_f64();
    strace.wait().unwrap();
    let text = std::fs::read_to_string(trace.path()).unwrap();
    let (mut calls, mut kinds) = ([0.0; 2], [0.0; 2]);
    for (name, bytes) in text.lines().filter_map(call) {
        let kind = usize::from(name.starts_with("send"));
        calls[kind] += 1.0;
        kinds[kind] += bytes as f64 * 1e-3;
    }
    Some(Calls {
        writes_s: calls[0] / seconds,
        written_kb_s: kinds[0] / seconds,
        sends_s: calls[1] / seconds,
        sent_kb_s: kinds[1] / seconds,
    })
}

/// Name and bytes of a line `PID NAME(ARGUMENTS) = BYTES`; `None` for a call that failed or was
/// cut by the end.
fn call(line: &str) -> Option<(&str, u64)> {
    let (call, result) = line.rsplit_once(" = ")?;
    let (_, name) = call.split_once('(')?.0.rsplit_once(' ')?;
    Some((name, result.split(' ').next()?.parse().ok()?))
}
