//! Two network namespaces with a bad radio between them (radio.py).

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Addresses at the two ends.
pub const ADDRESS: [&str; 2] = ["10.7.0.1", "10.7.0.2"];

/// The radio; all of it goes with this.
pub struct Radio {
    ends: [Child; 2],
    relay: Child,
    lines: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Radio {
    /// `None` where there is no TUN, or this user may not have networks of his own, outside of CI.
    pub fn new() -> Option<Self> {
        let own = Command::new("unshare").args(["-n", "ip", "link"]).output();
        let may = own.is_ok_and(|output| output.status.success());
        if !may || !Path::new("/dev/net/tun").exists() {
            assert!(
                may || std::env::var_os("CI").is_none(),
                "CI may have its own network"
            );
            println!("not run: no networks of one's own here, or no ip, or no /dev/net/tun");
            return None;
        }
        let namespace = || {
            let mut command = Command::new("unshare");
            command.args(["-n", "sleep", "10000"]).stdin(Stdio::null());
            command.spawn().unwrap()
        };
        let ends = [namespace(), namespace()];
        let own = std::fs::read_link("/proc/self/ns/net").unwrap();
        let begin = Instant::now();
        for end in &ends {
            let its = format!("/proc/{}/ns/net", end.id());
            while std::fs::read_link(&its).map_or(true, |its| its == own) {
                assert!(begin.elapsed() < Duration::from_secs(10), "no namespace");
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/support/radio.py");
        let mut relay = Command::new("python3")
            .arg(script)
            .args(ends.iter().map(|end| end.id().to_string()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = relay.stdin.take().unwrap();
        let answers = BufReader::new(relay.stdout.take().unwrap());
        let mut radio = Self {
            ends,
            relay,
            lines,
            answers,
        };
        assert_eq!(radio.answer(), "there");
        Some(radio)
    }

    fn answer(&mut self) -> String {
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        line.trim().to_owned()
    }

    /// Sets how it is; gives the bytes that have gone from the first end to the second one and
    /// back so far.
    pub fn set(&mut self, how: &str) -> [u64; 2] {
        writeln!(self.lines, "{how}").unwrap();
        let answer = self.answer();
        let bytes: Vec<u64> = answer
            .split(' ')
            .map(|word| word.parse().unwrap())
            .collect();
        [bytes[0], bytes[1]]
    }

    /// A program at one end.
    pub fn at(&self, end: usize, program: &Path) -> Command {
        let mut command = Command::new("nsenter");
        command.arg(format!("--net=/proc/{}/ns/net", self.ends[end].id()));
        command.arg(program);
        command
    }
}

impl Drop for Radio {
    fn drop(&mut self) {
        for child in self.ends.iter_mut().chain([&mut self.relay]) {
            // It may have ended.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
