//! Zenoh between the two ends: bytes of frames there and back, and who is refused.

use crate::keys::{AUTHORITY, OWN, OWN_KEY};
use crate::settings::Settings;
use anyhow::{Result, anyhow};
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Mutex, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber, span};
use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

/// Frames and remarks that wait for the loop at most; it takes them at once.
const WAITING: usize = 1024;
/// A message that is put together of several may have this many bytes: a frame is smaller. Zenoh
/// takes a gigabyte if nothing is said, also of one who has a key and no right.
const MESSAGE_MAX: usize = 1 << 21;
/// Remarks that are kept between two turns of the loop.
const REMARKS: usize = 16;

/// A name that no key has: names have no blanks, and Zenoh takes no empty one.
const NOBODY: &str = "nobody at all";

/// What Zenoh has to say since the last turn.
static REMARKED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// An open link.
pub struct Carrier {
    _session: Session,
    publisher: zenoh::pubsub::Publisher<'static>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
    frames: Receiver<Vec<u8>>,
    awake: UnixStream,
}

/// A link that is being opened, on a thread of its own: Zenoh may wait for the other end, for as
/// long as it refuses this one's key.
pub struct Opening(Receiver<Result<Carrier>>);

impl Opening {
    /// Begins.
    pub fn begin(settings: &Settings) -> Self {
        let (sender, opened) = mpsc::channel();
        let settings = settings.clone();
        std::thread::spawn(move || {
            // Nobody waits for it any more where the stage has ended.
            let _ = sender.send(Carrier::open(&settings));
        });
        Self(opened)
    }

    /// What became of it, once.
    pub fn poll(&self) -> Option<Result<Carrier>> {
        self.0.try_recv().ok()
    }
}

impl Carrier {
    /// Opens it: the base listens, the robot calls it again and again.
    fn open(settings: &Settings) -> Result<Self> {
        let failed = |cause: zenoh::Error| anyhow!("{}: {cause}", settings.address);
        let config = Config::from_json5(&configuration(settings)).map_err(failed)?;
        let session = zenoh::open(config).wait().map_err(failed)?;
        let name = &settings.robot;
        let (up, down) = (format!("randt/{name}/up"), format!("randt/{name}/down"));
        let (sends, takes) = if settings.is_base {
            (down, up)
        } else {
            (up, down)
        };
        let publisher = session
            .declare_publisher(sends)
            // A queue is this program's matter; what Zenoh drops goes again.
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait()
            .map_err(failed)?;
        let (sender, frames) = mpsc::sync_channel::<Vec<u8>>(WAITING);
        let (awake, waker) = UnixStream::pair()?;
        awake.set_nonblocking(true)?;
        waker.set_nonblocking(true)?;
        let subscriber = session
            .declare_subscriber(takes)
            .callback(move |sample| {
                deliver(&sender, sample.payload().to_bytes().into_owned(), &waker);
            })
            .wait()
            .map_err(failed)?;
        // Undeclared with the session.
        Ok(Self {
            _session: session,
            publisher,
            _subscriber: subscriber,
            frames,
            awake,
        })
    }

    /// Sends a frame. Where nobody is there, or the way is full, it is lost.
    pub fn send(&self, frame: Vec<u8>) {
        // What does not arrive is noticed by the answers.
        let _ = self.publisher.put(frame).wait();
    }

    /// The next frame that came.
    pub fn receive(&mut self) -> Option<Vec<u8>> {
        self.frames.try_recv().ok()
    }

    /// What becomes readable when a frame comes.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.awake.as_fd()
    }

    /// The wake-ups so far are taken: to be called before the frames are.
    pub fn take_notices(&mut self) {
        let mut bytes = [0; 256];
        while self.awake.read(&mut bytes).is_ok_and(|count| count > 0) {}
    }
}

fn deliver(sender: &SyncSender<Vec<u8>>, frame: Vec<u8>, mut waker: &UnixStream) {
    // A loop that hangs loses frames, and their senders notice that.
    let _ = sender.try_send(frame);
    // Full: it is awake already.
    let _ = waker.write(&[1]);
}

/// Zenoh's own configuration: nothing is searched for, nothing listens but the base.
fn configuration(settings: &Settings) -> String {
    let protocol = if settings.keys.is_some() {
        "tls"
    } else {
        "tcp"
    };
    let address = format!("{protocol}/{}", settings.address);
    let (listen, connect) = match settings.is_base {
        true => (format!("[{address:?}]"), "[]".to_owned()),
        false => ("[]".to_owned(), format!("[{address:?}]")),
    };
    let mut text = format!(
        r#"{{ mode: "peer",
            listen: {{ endpoints: {listen}, exit_on_failure: true }},
            connect: {{ endpoints: {connect}, timeout_ms: -1, exit_on_failure: false,
                retry: {{ period_init_ms: 500, period_max_ms: 2000, period_increase_factor: 2 }} }},
            scouting: {{ multicast: {{ enabled: false }}, gossip: {{ enabled: false }} }},
            adminspace: {{ enabled: false }},
            transport: {{ link: {{ rx: {{ max_message_size: {MESSAGE_MAX} }}, "#
    );
    if let Some(keys) = &settings.keys {
        let file = |name: &str| keys.join(name).display().to_string();
        let (authority, own, key) = (file(AUTHORITY), file(OWN), file(OWN_KEY));
        // Who is there is in the key's name, which the access rule below asks for, and not in an
        // address.
        let _ = write!(
            text,
            r#"protocols: ["tls"], tls: {{ root_ca_certificate: {authority:?}, enable_mtls: true,
                listen_certificate: {own:?}, listen_private_key: {key:?},
                connect_certificate: {own:?}, connect_private_key: {key:?},
                verify_name_on_connect: false, close_link_on_expiration: true }}"#
        );
    }
    text.push_str("} } ");
    if settings.keys.is_some() {
        let robot = &settings.robot;
        let allowed = match settings.is_refused() {
            true => NOBODY,
            false => settings.peer(),
        };
        let _ = write!(
            text,
            r#", access_control: {{ enabled: true, default_permission: "deny",
                rules: [{{ id: "link", permission: "allow", flows: ["egress", "ingress"],
                    messages: ["put", "declare_subscriber"], key_exprs: ["randt/{robot}/**"] }}],
                subjects: [{{ id: "peer", cert_common_names: [{allowed:?}] }}],
                policies: [{{ rules: ["link"], subjects: ["peer"] }}] }}"#
        );
    }
    text.push('}');
    text
}

/// Takes what Zenoh remarks of connections; to be called once.
pub fn listen_to_remarks() {
    // Another one is none of this program's.
    let _ = tracing::subscriber::set_global_default(Remarks);
}

/// What was remarked since the last call.
pub fn take_remarks() -> Vec<String> {
    let mut remarked = REMARKED.lock().unwrap_or_else(PoisonError::into_inner);
    std::mem::take(&mut *remarked)
}

/// Zenoh's warnings, and who has shown which key.
struct Remarks;

impl Subscriber for Remarks {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        let target = metadata.target();
        let is_link = ["zenoh_link", "zenoh_transport", "zenoh::net::runtime"];
        let is_link = is_link.iter().any(|begin| target.starts_with(begin));
        let level = *metadata.level();
        target.starts_with("zenoh") && (level <= Level::WARN || is_link && level <= Level::DEBUG)
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut text = Text(String::new());
        event.record(&mut text);
        let is_warning = *event.metadata().level() <= Level::WARN;
        // Of what is not a warning only the keys matter.
        let marks = ["Accepted TLS", "peer certificate", "fatal alert"];
        if !is_warning && !marks.iter().any(|mark| text.0.contains(mark)) {
            return;
        }
        let mut remarked = REMARKED.lock().unwrap_or_else(PoisonError::into_inner);
        if remarked.len() < REMARKS {
            remarked.push(text.0);
        }
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}");
        }
    }
}
