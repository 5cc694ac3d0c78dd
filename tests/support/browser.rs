//! A real browser without a window, and pages that try to watch and report what they got.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const BROWSER: &str = "chromium";
/// A browser starts in a second; a machine may be busy.
const WAIT_MAX: Duration = Duration::from_secs(60);

/// The page: it tries by itself, from a worker and from a sandboxed frame, and reports three
/// words. TARGET is the address to watch, REPORT where the words go.
const PAGE: &str = r#"<!DOCTYPE html><title>page</title><script>
const attempt = `(target, report) => {
  const protocols = ["foxglove.websocket.v1", "foxglove.sdk.v1"];
  const socket = new WebSocket(target, protocols);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => {
    if (typeof event.data === "string") {
      if (JSON.parse(event.data).op === "serverInfo") {
        socket.send(JSON.stringify({ op: "subscribe", subscriptions: [{ id: 1, channelId: 1 }] }));
      }
    } else if (new TextDecoder().decode(event.data).includes("no pose yet")) {
      report("status");
      socket.close();
    }
  };
  socket.onclose = () => report("nothing");
}`;
const words = [null, null, null];
const report = (place, word) => {
  words[place] = words[place] ?? word;
  if (words.every((word) => word)) fetch("REPORT?" + words.join("+"), { mode: "no-cors" });
};
eval(attempt)("TARGET", (word) => report(0, word));
const code = `(${attempt})("TARGET", (word) => postMessage(word));`;
const worker = new Worker(URL.createObjectURL(new Blob([code])));
worker.onmessage = (event) => report(1, event.data);
window.onmessage = (event) => report(2, event.data);
const frame = document.createElement("iframe");
frame.sandbox = "allow-scripts";
frame.srcdoc = `<script>(${attempt})("TARGET", (word) => parent.postMessage(word, "*"));<\/script>`;
document.documentElement.append(frame);
</script>"#;

/// A server of pages, under any name.
pub struct Pages {
    address: SocketAddr,
    reports: Receiver<String>,
}

impl Pages {
    pub fn serve() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (sender, reports) = channel();
        std::thread::spawn(move || {
            while let Ok((stream, _)) = listener.accept() {
                let sender = sender.clone();
                std::thread::spawn(move || {
                    let target = answer(stream, address);
                    if let Some((_, words)) = target.unwrap_or_default().split_once("/report?") {
                        // The test may be over.
                        let _ = sender.send(words.replace('+', " "));
                    }
                });
            }
        });
        Self { address, reports }
    }
}

/// Answers one request with the page of its target; gives the target.
fn answer(mut stream: TcpStream, address: SocketAddr) -> Option<String> {
    let mut lines = BufReader::new(stream.try_clone().ok()?).lines();
    let request = lines.next()?.ok()?;
    let host = lines.find_map(|line| Some(line.ok()?.strip_prefix("Host: ")?.to_owned()));
    let target = request.split(' ').nth(1)?.to_owned();
    let body = match target.strip_prefix("/page?") {
        Some(watch) => page(watch, &host.unwrap_or_else(|| address.to_string())),
        None => String::new(),
    };
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nConnection: close\r\nContent-Length";
    write!(stream, "{head}: {}\r\n\r\n{body}", body.len()).ok()?;
    Some(target)
}

fn page(watch: &str, host: &str) -> String {
    let report = format!("http://{host}/report");
    PAGE.replace("TARGET", watch).replace("REPORT", &report)
}

/// Chromium.
pub struct Browser {
    folder: tempfile::TempDir,
}

/// A running one, killed with all its processes in the end.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let group = rustix::process::Pid::from_child(&self.0);
        // It may have ended.
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        let _ = self.0.wait();
    }
}

impl Browser {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { folder }
    }

    /// Opens a page that a host serves and that tries to watch; gives what it got in all three
    /// ways.
    pub fn visit(&self, pages: &Pages, host: &str, watch: &str) -> String {
        let url = format!("http://{host}:{}/page?{watch}", pages.address.port());
        self.report(pages, &url, &[])
    }

    /// The same of a file.
    pub fn visit_file(&self, pages: &Pages, watch: &str, options: &[&str]) -> String {
        let path: PathBuf = self.folder.path().join("page.html");
        std::fs::write(&path, page(watch, &pages.address.to_string())).unwrap();
        self.report(pages, &format!("file://{}", path.display()), options)
    }

    fn report(&self, pages: &Pages, url: &str, options: &[&str]) -> String {
        use std::os::unix::process::CommandExt;
        let data = tempfile::tempdir_in(self.folder.path()).unwrap();
        let mut command = Command::new(BROWSER);
        command
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic"])
            .args(["--no-first-run", "--disable-background-networking", "--disable-sync"])
            .args(["--disable-component-update", "--remote-debugging-port=0"])
            // What a rebinding name server would answer, and no other host.
            .arg("--host-resolver-rules=MAP evil.example 127.0.0.1, MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1")
            .arg(format!("--user-data-dir={}", data.path().display()))
            .args(options)
            .arg(url)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0);
        let child = command.spawn();
        let running = Running(child.unwrap_or_else(|error| panic!("{BROWSER}: {error}")));
        let report = pages.reports.recv_timeout(WAIT_MAX);
        drop(running);
        report.unwrap_or_else(|error| panic!("{url}: {error}"))
    }
}
