//! A viewer as Foxglove and Lichtblick are one, and a link that is as slow as a radio's.

use foxglove::Decode;
use foxglove::messages::SceneUpdate;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// A message as it came.
#[derive(Clone, Debug)]
pub struct Got {
    pub topic: String,
    pub schema: String,
    pub log_time_ns: u64,
    pub payload: Vec<u8>,
    pub at: Instant,
}

/// What a viewer has got so far, in the order in which it came.
#[derive(Default)]
pub struct Heard {
    pub messages: Vec<Got>,
    /// Topics that were offered.
    pub topics: Vec<String>,
    /// Tiles by name, as last drawn.
    pub tiles: BTreeMap<String, Vec<u8>>,
    /// The last status, and whether it was red.
    pub status: Option<(String, bool)>,
    pub has_ended: bool,
}

/// A viewer that subscribes to everything and is read by a thread.
pub struct Viewer {
    pub heard: Arc<Mutex<Heard>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Connects as a viewer does.
pub fn connect(address: SocketAddr) -> Result<WebSocket<TcpStream>, String> {
    let mut request = format!("ws://{address}").into_client_request().unwrap();
    let protocol = HeaderValue::from_static("foxglove.websocket.v1");
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let stream = TcpStream::connect(address).map_err(|error| error.to_string())?;
    stream.set_nodelay(true).unwrap();
    let (socket, response) = tungstenite::client(request, stream).map_err(|e| e.to_string())?;
    assert_eq!(
        response.headers()["Sec-WebSocket-Protocol"],
        "foxglove.websocket.v1"
    );
    Ok(socket)
}

impl Viewer {
    /// Watches from now on.
    pub fn open(address: SocketAddr) -> Self {
        let begin = Instant::now();
        let mut socket = loop {
            match connect(address) {
                Ok(socket) => break socket,
                Err(error) => assert!(begin.elapsed().as_secs() < 60, "{address}: {error}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        let wait = Some(Duration::from_millis(50));
        socket.get_ref().set_read_timeout(wait).unwrap();
        let heard = Arc::new(Mutex::new(Heard::default()));
        let stop = Arc::new(AtomicBool::new(false));
        let thread = {
            let (heard, stop) = (Arc::clone(&heard), Arc::clone(&stop));
            std::thread::spawn(move || {
                let mut channels = BTreeMap::new();
                while !stop.load(Ordering::Relaxed) {
                    match socket.read() {
                        Ok(Message::Text(text)) => {
                            let output: Value = serde_json::from_str(&text).unwrap();
                            subscribe(&output, &mut socket, &mut channels, &heard);
                        }
                        Ok(Message::Binary(bytes)) => take(&bytes, &channels, &heard),
                        Ok(_) => {}
                        Err(tungstenite::Error::Io(error))
                            if error.kind() == std::io::ErrorKind::WouldBlock => {}
                        Err(_) => break,
                    }
                }
                heard.lock().unwrap().has_ended = true;
            })
        };
        let thread = Some(thread);
        Self {
            heard,
            stop,
            thread,
        }
    }

    /// Messages of a topic so far.
    pub fn on_topic(&self, topic: &str) -> Vec<Got> {
        let heard = self.heard.lock().unwrap();
        let found = heard.messages.iter().filter(|got| got.topic == topic);
        found.cloned().collect()
    }

    pub fn tiles(&self) -> BTreeMap<String, Vec<u8>> {
        self.heard.lock().unwrap().tiles.clone()
    }

    pub fn status(&self) -> (String, bool) {
        self.heard
            .lock()
            .unwrap()
            .status
            .clone()
            .unwrap_or_default()
    }

    pub fn has_ended(&self) -> bool {
        self.heard.lock().unwrap().has_ended
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

type Channels = BTreeMap<u32, (String, String)>;

/// Subscribes to what is offered, under numbers of its own.
fn subscribe(
    output: &Value,
    socket: &mut WebSocket<TcpStream>,
    channels: &mut Channels,
    heard: &Mutex<Heard>,
) {
    match output["op"].as_str().unwrap() {
        "serverInfo" => assert_eq!(output["capabilities"], json!(["time"])),
        "advertise" => {
            for channel in output["channels"].as_array().unwrap() {
                let text = |key: &str| channel[key].as_str().unwrap().to_owned();
                let is_ours = !text("topic").starts_with("view/");
                let expected = if is_ours { "cdr" } else { "protobuf" };
                assert_eq!(text("encoding"), expected, "{channel}");
                let id = channel["id"].as_u64().unwrap() as u32;
                channels.insert(1000 + id, (text("topic"), text("schemaName")));
                heard.lock().unwrap().topics.push(text("topic"));
                let wanted = json!([{ "id": 1000 + id, "channelId": id }]);
                let request = json!({ "op": "subscribe", "subscriptions": wanted });
                socket.send(Message::text(request.to_string())).unwrap();
            }
        }
        other => panic!("{other}: {output}"),
    }
}

fn take(bytes: &[u8], channels: &Channels, heard: &Mutex<Heard>) {
    if bytes[0] == 2 {
        assert_eq!(bytes.len(), 9);
        return;
    }
    assert_eq!(bytes[0], 1);
    let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
    let (topic, schema) = channels[&subscription].clone();
    let payload = bytes[13..].to_vec();
    let mut heard = heard.lock().unwrap();
    if topic == "view/grid" || topic == "view/status" {
        let update = SceneUpdate::decode(payload.as_slice()).unwrap();
        if !update.deletions.is_empty() {
            heard.tiles.clear();
        }
        for entity in update.entities {
            if topic == "view/grid" {
                heard.tiles.insert(entity.id, payload.clone());
            } else {
                let text = &entity.texts[0];
                let colour = text.color.unwrap();
                heard.status = Some((text.text.clone(), colour.r > 0.9 && colour.g < 0.2));
            }
        }
    }
    heard.messages.push(Got {
        topic,
        schema,
        log_time_ns: u64::from_le_bytes(bytes[5..13].try_into().unwrap()),
        payload,
        at: Instant::now(),
    });
}

/// A link in front of a server, for one viewer at a time: that many bytes a second towards the
/// viewer, and a delay each way. Like ssh it takes from the server whatever the system's buffers
/// hold.
pub fn slow_link(server: SocketAddr, bytes_s: f64, delay: Duration) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        while let Ok((viewer, _)) = listener.accept() {
            let Ok(inner) = TcpStream::connect(server) else {
                continue;
            };
            for stream in [&viewer, &inner] {
                stream.set_nodelay(true).unwrap();
            }
            let back = (viewer.try_clone().unwrap(), inner.try_clone().unwrap());
            carry(inner, viewer, Some(bytes_s), delay);
            carry(back.0, back.1, None, delay);
        }
    });
    address
}

/// Carries one direction; ends with it.
fn carry(mut from: TcpStream, mut to: TcpStream, bytes_s: Option<f64>, delay: Duration) {
    let (sender, receiver) = channel::<(Instant, Vec<u8>)>();
    std::thread::spawn(move || {
        let mut bytes = [0; 500];
        let mut free = Instant::now();
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            if let Some(bytes_s) = bytes_s {
                free = free.max(Instant::now()) + Duration::from_secs_f64(count as f64 / bytes_s);
                std::thread::sleep(free.saturating_duration_since(Instant::now()));
            }
            if sender
                .send((Instant::now() + delay, bytes[..count].to_vec()))
                .is_err()
            {
                break;
            }
        }
    });
    std::thread::spawn(move || {
        while let Ok((due, bytes)) = receiver.recv() {
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            if to.write_all(&bytes).is_err() {
                break;
            }
        }
        let _ = to.shutdown(std::net::Shutdown::Both);
    });
}
