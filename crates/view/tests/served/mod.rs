//! A server on a thread, and tabs that speak to it.
#![allow(dead_code, reason = "each test takes its part")]

use relight_play::Player;
use relight_view::{Exhibit, Reopen, View};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

pub fn player() -> Player {
    Player::open("../play/tests/cornell.relight").unwrap()
}

/// A player and its scene's own lights.
pub fn exhibit(player: Player) -> Exhibit {
    Exhibit {
        sequence: player.scene().sequence.clone(),
        player,
        asset: "cornell.relight".into(),
        lights_file: None,
        seed: 0,
    }
}

/// A server that ends with the test.
pub struct Served {
    pub url: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    pub fn new() -> Served {
        Served::of(exhibit(player()))
    }

    pub fn of(exhibit: Exhibit) -> Served {
        Served::at("127.0.0.1:0", exhibit)
    }

    /// One that listens at this address.
    pub fn at(address: &str, exhibit: Exhibit) -> Served {
        Served::view(View::bind(address.parse().unwrap(), exhibit).unwrap())
    }

    /// One that shows what stands in a file, whenever that is replaced.
    pub fn watching(exhibit: Exhibit, file: PathBuf, reopen: Reopen) -> Served {
        let view = View::bind("127.0.0.1:0".parse().unwrap(), exhibit).unwrap();
        Served::view(view.watching(file, reopen))
    }

    fn view(view: View) -> Served {
        let (url, stop) = (view.url(), Arc::new(AtomicBool::new(false)));
        let heard = stop.clone();
        let thread = std::thread::spawn(move || view.serve(|| heard.load(Ordering::Relaxed)).unwrap());
        Served {
            url,
            stop,
            thread: Some(thread),
        }
    }

    pub fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking());
        }
    }
}

/// Status and body of an answer.
fn ask(url: &str, method: &str, body: &[u8]) -> (u16, Vec<u8>) {
    let (host, path) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let length = body.len();
    let head = format!(
        "{method} /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).unwrap();
    // Who says no early doesn't read to the end.
    let _ = stream.write_all(body);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    let head = String::from_utf8_lossy(&answer[..end]).into_owned();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, answer[end + 4..].to_vec())
}

pub fn get(url: &str) -> (u16, String) {
    let (status, body) = ask(url, "GET", b"");
    (status, String::from_utf8_lossy(&body).into_owned())
}

pub fn post(url: &str, body: impl AsRef<[u8]>) -> (u16, Vec<u8>) {
    ask(url, "POST", body.as_ref())
}

/// A tab as the server sees one.
pub struct Tab {
    pub socket: WebSocket<MaybeTlsStream<TcpStream>>,
}

impl Tab {
    pub fn connect(url: &str) -> Tab {
        let (socket, _) = tungstenite::connect(format!("{url}socket").replace("http", "ws")).unwrap();
        let tab = Tab { socket };
        tab.wait_up_to(PATIENCE);
        tab
    }

    /// Connects and hears what is shown.
    pub fn open(url: &str) -> Tab {
        let mut tab = Tab::connect(url);
        assert!(tab.hello().is_some());
        tab
    }

    fn wait_up_to(&self, time: Duration) {
        if let MaybeTlsStream::Plain(stream) = self.socket.get_ref() {
            stream.set_read_timeout(Some(time)).unwrap();
        }
    }

    pub fn hello(&mut self) -> Option<Value> {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                let words: Value = serde_json::from_str(&text).unwrap();
                Some(words["hello"].clone())
            }
            _ => None,
        }
    }

    pub fn send(&mut self, message: &Value) {
        self.send_text(&message.to_string());
    }

    pub fn send_text(&mut self, text: &str) {
        self.socket.send(text.to_owned().into()).unwrap();
    }

    /// The next words under this name, whatever comes between.
    pub fn words(&mut self, name: &str) -> Value {
        loop {
            if let Message::Text(text) = self.socket.read().unwrap() {
                let words: Value = serde_json::from_str(&text).unwrap();
                if let Some(value) = words.get(name) {
                    return value.clone();
                }
            }
        }
    }

    pub fn refused(&mut self) -> String {
        self.words("refused")["what"].as_str().unwrap().to_owned()
    }

    /// The next picture: its head and its file.
    pub fn picture(&mut self) -> (Value, Vec<u8>) {
        loop {
            match self.socket.read().unwrap() {
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let head = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    return (head, bytes[4 + length..].to_vec());
                }
                Message::Text(text) => panic!("instead of a picture: {text}"),
                _ => {}
            }
        }
    }

    pub fn picture_at(&mut self, stage: &str) -> (Value, Vec<u8>) {
        loop {
            let (head, file) = self.picture();
            if head["stage"] == stage {
                return (head, file);
            }
        }
    }

    /// Whether nothing comes for a while.
    pub fn silent(&mut self) -> bool {
        self.wait_up_to(Duration::from_millis(300));
        let silent = !matches!(self.socket.read(), Ok(Message::Binary(_) | Message::Text(_)));
        self.wait_up_to(PATIENCE);
        silent
    }

    /// Whether the server closes, whatever comes before.
    pub fn closes(&mut self) -> bool {
        loop {
            match self.socket.read() {
                Ok(Message::Close(_)) => return true,
                Err(tungstenite::Error::Io(error)) => {
                    return !matches!(
                        error.kind(),
                        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                    );
                }
                Err(_) => return true,
                Ok(_) => {}
            }
        }
    }
}
