//! Chromium by the DevTools protocol: one page, its pictures, clicks and errors.

use serde_json::{Value, json};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const PATIENCE: Duration = Duration::from_secs(120);

pub struct Chromium {
    child: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: String,
    last: u64,
    errors: Vec<String>,
    folder: TempDir,
    downloads: PathBuf,
}

impl Drop for Chromium {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Chromium {
    /// Starts one; `None` where none is installed.
    pub fn start() -> Option<Chromium> {
        let folder = tempfile::tempdir().unwrap();
        let child = ["chromium", "chromium-browser", "google-chrome"]
            .iter()
            .find_map(|name| {
                Command::new(name)
                    .args([
                        "--headless",
                        "--no-sandbox",
                        "--disable-gpu",
                        "--disable-dev-shm-usage",
                        // WebGL without a GPU.
                        "--enable-unsafe-swiftshader",
                    ])
                    .args([
                        "--remote-debugging-port=0",
                        "--no-first-run",
                        "--force-color-profile=srgb",
                    ])
                    .arg(format!("--user-data-dir={}", folder.path().display()))
                    .arg("about:blank")
                    .stdin(Stdio::null())
                    .stdout(Stdio::null())
                    .stderr(Stdio::null())
                    .spawn()
                    .ok()
            })?;
        let started = Instant::now();
        let port = folder.path().join("DevToolsActivePort");
        let address = loop {
            let text = std::fs::read_to_string(&port).unwrap_or_default();
            if let Some((port, path)) = text.split_once('\n').filter(|(_, path)| !path.is_empty()) {
                break format!("ws://127.0.0.1:{port}{}", path.trim());
            }
            assert!(started.elapsed() < PATIENCE, "chromium does not start");
            std::thread::sleep(Duration::from_millis(50));
        };
        let (socket, _) = tungstenite::connect(address).unwrap();
        let downloads = folder.path().join("downloads");
        std::fs::create_dir(&downloads).unwrap();
        let mut page = Chromium {
            child,
            socket,
            session: String::new(),
            last: 0,
            errors: Vec::new(),
            folder,
            downloads,
        };
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = page.call(
            "Target.attachToTarget",
            json!({ "targetId": target, "flatten": true }),
        );
        page.session = attached["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Runtime", "Log", "Page"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": 1280, "height": 800, "deviceScaleFactor": 1, "mobile": false }),
        );
        let path = page.downloads.display().to_string();
        page.call(
            "Browser.setDownloadBehavior",
            json!({ "behavior": "allow", "downloadPath": path }),
        );
        Some(page)
    }

    pub fn downloads(&self) -> &Path {
        &self.downloads
    }

    /// Errors in the page's console so far.
    pub fn errors(&self) -> Vec<String> {
        self.errors.clone()
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": params });
        if !self.session.is_empty() && !method.starts_with("Browser.") {
            message["sessionId"] = json!(self.session);
        }
        self.socket.send(message.to_string().into()).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else {
                continue;
            };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.last {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            self.note(&answer);
        }
    }

    fn note(&mut self, event: &Value) {
        let params = &event["params"];
        match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => self.errors.push(params["exceptionDetails"].to_string()),
            Some("Log.entryAdded") if params["entry"]["level"] == "error" => {
                self.errors.push(params["entry"].to_string());
            }
            Some("Runtime.consoleAPICalled") if params["type"] == "error" => {
                self.errors.push(params["args"].to_string());
            }
            _ => {}
        }
    }

    pub fn evaluate(&mut self, script: &str) -> Value {
        let result = self.call(
            "Runtime.evaluate",
            json!({ "expression": format!("(() => {{ {script} }})()"), "returnByValue": true }),
        );
        assert!(result["exceptionDetails"].is_null(), "{script}: {result}");
        result["result"]["value"].clone()
    }

    pub fn wait(&mut self, condition: &str) {
        let start = Instant::now();
        while self.evaluate(&format!("return Boolean({condition})")) != true {
            assert!(
                start.elapsed() < PATIENCE,
                "never: {condition}; errors: {:?}",
                self.errors
            );
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Runs a script in every page before its own.
    pub fn before(&mut self, script: &str) {
        self.call(
            "Page.addScriptToEvaluateOnNewDocument",
            json!({ "source": script }),
        );
    }

    pub fn navigate(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
        self.wait("document.readyState === 'complete'");
    }

    pub fn reload(&mut self) {
        self.evaluate("document.body.dataset.stage = 'old'; document.body.id = 'old'");
        self.call("Page.reload", json!({}));
        self.wait("document.readyState === 'complete' && document.body.id !== 'old'");
    }

    /// A screen of so many pixels, whose user likes it dark or light.
    pub fn screen(&mut self, width: u32, height: u32, dark: bool) {
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false }),
        );
        let scheme = if dark { "dark" } else { "light" };
        self.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] }),
        );
    }

    /// A window of so many pixels of the screen, of which the page's are `percent` of a hundred wide.
    pub fn zoom(&mut self, width: u32, height: u32, percent: u32) {
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({
                "width": width * 100 / percent, "height": height * 100 / percent,
                "deviceScaleFactor": f64::from(percent) / 100.0, "mobile": false,
            }),
        );
    }

    /// Presses a key by its name.
    pub fn press(&mut self, key: &str) {
        let code = match key {
            "Tab" => 9,
            "Enter" => 13,
            "ArrowLeft" => 37,
            _ => u32::from(key.as_bytes()[0]),
        };
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({ "type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code });
            if kind == "keyDown" && !["Tab", "ArrowLeft"].contains(&key) {
                event["text"] = json!(if key == "Enter" { "\r" } else { key });
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Waits until the newest wish is shown, refined.
    pub fn rest(&mut self) {
        self.wait(
            "document.body.dataset.stage === 'final' && document.body.dataset.shown === document.body.dataset.wanted",
        );
    }

    /// The canvas, RGBA.
    pub fn picture(&mut self) -> Vec<u8> {
        let text = self.evaluate(
            "const c = document.querySelector('#stage canvas');
             const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height);
             let hex = ''; for (const v of data) hex += String.fromCharCode(97 + (v >> 4), 97 + (v & 15)); return hex",
        );
        let letters = text.as_str().unwrap().as_bytes().chunks_exact(2);
        letters.map(|pair| (pair[0] - 97) << 4 | (pair[1] - 97)).collect()
    }

    /// Chooses of a list.
    pub fn choose(&mut self, selector: &str, value: &str) {
        let (selector, value) = (json!(selector), json!(value));
        self.evaluate(&format!(
            "const list = document.querySelector({selector}); list.value = {value}; list.dispatchEvent(new Event('change'))"
        ));
    }

    /// Clicks the button of these words.
    pub fn click_button(&mut self, words: &str) {
        let words = json!(words);
        self.evaluate(&format!(
            "[...document.querySelectorAll('button')].find((button) => button.textContent === {words}).click()"
        ));
    }

    /// Two fingers that part by so many pixels.
    pub fn pinch(&mut self, selector: &str, by: f64) {
        let [x, y] = self.middle_of(selector);
        let fingers =
            |apart: f64| json!([{ "x": x - apart, "y": y, "id": 0 }, { "x": x + apart, "y": y, "id": 1 }]);
        self.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": true }));
        self.call(
            "Input.dispatchTouchEvent",
            json!({ "type": "touchStart", "touchPoints": fingers(40.0) }),
        );
        for step in 1..=5 {
            let apart = 40.0 + by / 2.0 * f64::from(step) / 5.0;
            self.call(
                "Input.dispatchTouchEvent",
                json!({ "type": "touchMove", "touchPoints": fingers(apart) }),
            );
        }
        self.call(
            "Input.dispatchTouchEvent",
            json!({ "type": "touchEnd", "touchPoints": [] }),
        );
    }

    pub fn middle_of(&mut self, selector: &str) -> [f64; 2] {
        self.within(selector, [0.5, 0.5])
    }

    pub fn within(&mut self, selector: &str, at: [f64; 2]) -> [f64; 2] {
        let quoted = json!(selector);
        let place = self.evaluate(&format!(
            "const r = document.querySelector({quoted}).getBoundingClientRect();
             return [r.x + r.width * {}, r.y + r.height * {}]",
            at[0], at[1]
        ));
        [0, 1].map(|i| place[i].as_f64().unwrap())
    }

    pub fn mouse(&mut self, kind: &str, [x, y]: [f64; 2]) {
        let buttons = u8::from(kind != "mouseReleased");
        self.call(
            "Input.dispatchMouseEvent",
            json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 }),
        );
    }

    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mousePressed", from);
        for step in 1..=10 {
            let t = f64::from(step) / 10.0;
            self.mouse("mouseMoved", [0, 1].map(|i| from[i] + (to[i] - from[i]) * t));
            std::thread::sleep(Duration::from_millis(16));
        }
        self.mouse("mouseReleased", to);
    }

    pub fn click(&mut self, selector: &str) {
        self.click_at(selector, [0.5, 0.5]);
    }

    pub fn click_at(&mut self, selector: &str, at: [f64; 2]) {
        let place = self.within(selector, at);
        self.mouse("mousePressed", place);
        self.mouse("mouseReleased", place);
    }

    /// Keeps a picture of what the screen shows, or of all of the page, where `RELIGHT_SCREENSHOTS` says.
    pub fn screenshot(&mut self, name: &str) {
        self.screenshot_of(name, false);
    }

    /// As [`Chromium::screenshot`]; `whole`: of all of the page.
    pub fn screenshot_of(&mut self, name: &str, whole: bool) {
        use std::io::Write;
        let Some(folder) = std::env::var_os("RELIGHT_SCREENSHOTS") else {
            return;
        };
        let shot = self.call(
            "Page.captureScreenshot",
            json!({ "format": "png", "captureBeyondViewport": whole }),
        );
        let decoder = shot["data"].as_str().unwrap().bytes().filter_map(|c| match c {
            b'A'..=b'Z' => Some(c - b'A'),
            b'a'..=b'z' => Some(c - b'a' + 26),
            b'0'..=b'9' => Some(c - b'0' + 52),
            b'+' => Some(62),
            b'/' => Some(63),
            _ => None,
        });
        let sixes: Vec<u8> = decoder.collect();
        let mut bytes = Vec::new();
        for four in sixes.chunks(4) {
            let bits =
                four.iter().fold(0_u32, |all, six| all << 6 | u32::from(*six)) << (6 * (4 - four.len()));
            bytes.extend_from_slice(&bits.to_be_bytes()[1..four.len()]);
        }
        let file = Path::new(&folder).join(format!("{name}.png"));
        std::fs::File::create(file).unwrap().write_all(&bytes).unwrap();
        assert!(self.folder.path().exists());
    }
}
