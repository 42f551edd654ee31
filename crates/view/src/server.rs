//! HTTP and WebSockets: the page, pictures to save, maps that were dropped, and each tab's socket. All of it only below the token.

use crate::desk::{Desk, Save};
use crate::exhibit::{Exhibit, Reopen};
use crate::wish::{Message, Show, message};
use crate::{page, worker};
use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message as Sent, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use relight_play::glam::Vec3;
use relight_play::scene::image::{Limits, decode_environment};
use relight_play::scene::light::EnvironmentMap;
use serde_json::json;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Semaphore, oneshot};
use tokio::time::{sleep, timeout};

/// Most bytes of a message and of a picture's description: some ten thousand lights.
pub const MOST_MESSAGE: usize = 16 << 20;
/// Most bytes of a map that is dropped, and most of its pixels: 8192 × 4096.
const MOST_MAP: (usize, u64) = (512 << 20, 1 << 25);
/// Messages of a tab that make no sense before it is sent away.
const MOST_GARBAGE: u32 = 32;
/// How long a tab may take to receive a picture.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often a silent tab is asked whether it is there.
const SILENCE: Duration = Duration::from_secs(20);

/// How often the asset's file is looked at.
const WATCH: Duration = Duration::from_secs(1);

/// Nothing from elsewhere, no address in a referrer, nothing kept.
const HEADERS: [(header::HeaderName, &str); 4] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; img-src 'self' blob: data:; connect-src 'self'; frame-ancestors 'none'; \
         base-uri 'none'; form-action 'none'",
    ),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::CACHE_CONTROL, "no-store"),
];

/// Why nothing is shown.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Somebody else is there.
    #[error(
        "port {} of {} is in use, perhaps by another relight view: open that one, end it, or choose another port with \
         --port N (0: any that is free)", .0.port(), .0.ip()
    )]
    InUse(SocketAddr),
    /// The system refuses the address.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// Why not.
        source: std::io::Error,
    },
    /// The system has no random numbers.
    #[error("no random token: {0}")]
    Token(getrandom::Error),
    /// The server failed.
    #[error("the server failed: {0}")]
    Serve(std::io::Error),
}

/// A server that listens and does not serve yet.
pub struct View {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    exhibit: Exhibit,
    watched: Option<(PathBuf, Reopen)>,
}

struct Shared {
    token: String,
    desk: Desk,
    /// One map is decoded at a time.
    decoding: Semaphore,
}

impl View {
    /// Listens.
    ///
    /// # Errors
    /// [`ViewError`].
    pub fn bind(address: SocketAddr, exhibit: Exhibit) -> Result<View, ViewError> {
        let failed = |source: std::io::Error| match source.kind() {
            ErrorKind::AddrInUse => ViewError::InUse(address),
            _ => ViewError::Listen { address, source },
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(ViewError::Token)?;
        Ok(View {
            listener,
            address,
            token: random.map(|byte| format!("{byte:02x}")).concat(),
            exhibit,
            watched: None,
        })
    }

    /// Shows another asset as soon as one stands, whole, in its file.
    pub fn watching(self, file: PathBuf, reopen: Reopen) -> View {
        View {
            watched: Some((file, reopen)),
            ..self
        }
    }

    /// The page's address, token included: whoever has it may look.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Serves until `stopped` says so.
    ///
    /// # Errors
    /// [`ViewError::Serve`].
    pub fn serve(self, stopped: impl Fn() -> bool) -> Result<(), ViewError> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(ViewError::Serve)?;
        let shared = Arc::new(Shared {
            token: self.token,
            desk: Desk::new(self.exhibit.maps(), self.exhibit.hello().to_string()),
            decoding: Semaphore::new(1),
        });
        let (listener, exhibit) = (self.listener, self.exhibit);
        let (file, reopen) = self.watched.unzip();
        std::thread::scope(|scope| {
            let desk = &shared.desk;
            let painting = std::thread::Builder::new()
                .name("relight-view".into())
                .spawn_scoped(scope, move || worker::work(exhibit, desk, reopen))
                .map_err(ViewError::Serve)?;
            let served = runtime.block_on(async {
                let listener = tokio::net::TcpListener::from_std(listener)?;
                let serving = axum::serve(listener, router(shared.clone()));
                tokio::select! {
                    served = async { serving.await } => served,
                    () = async { while !stopped() { sleep(Duration::from_millis(50)).await } } => Ok(()),
                    () = watch(file, desk) => Ok(()),
                }
            });
            desk.close();
            // Tabs hear of it.
            runtime.block_on(async { sleep(Duration::from_millis(100)).await });
            runtime.shutdown_timeout(Duration::from_millis(200));
            let _ = painting.join();
            served.map_err(ViewError::Serve)
        })
    }
}

/// Tells the desk whenever another file stands where the asset's was, once that no longer changes.
async fn watch(file: Option<PathBuf>, desk: &Desk) {
    let Some(file) = file else {
        return std::future::pending().await;
    };
    let stamp = || {
        let about = std::fs::metadata(&file).ok()?;
        Some((about.modified().ok()?, about.len()))
    };
    let mut shown = stamp();
    let mut last = shown;
    loop {
        sleep(WATCH).await;
        let now = stamp();
        if now.is_some() && now == last && now != shown {
            shown = now;
            desk.reopen();
        }
        last = now;
    }
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/{token}/", get(index))
        .route("/{token}/{file}", get(file))
        .route("/{token}/socket", get(socket))
        .route(
            "/{token}/render.exr",
            post(render).layer(DefaultBodyLimit::max(MOST_MESSAGE)),
        )
        .route(
            "/{token}/maps/{name}",
            post(map).layer(DefaultBodyLimit::max(MOST_MAP.0)),
        )
        .fallback(|| async { words(StatusCode::NOT_FOUND, NOT_HERE) })
        .with_state(shared)
}

const NOT_HERE: &str =
    "Nothing is here. Open the whole address that relight view printed: it ends in a long random word.";
const WRONG_TOKEN: &str = "This address is of another relight view, perhaps of one that has ended. Open the one that the last \
                           relight view printed.";

fn words(status: StatusCode, text: &str) -> Response {
    (status, guarded("text/plain; charset=utf-8"), text.to_owned()).into_response()
}

fn guarded(media: &'static str) -> HeaderMap {
    let mut headers: HeaderMap = (HEADERS.iter())
        .map(|(name, value)| (name.clone(), HeaderValue::from_static(value)))
        .collect();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    headers
}

impl Shared {
    /// Refuses a wrong token, in a time that doesn't tell how wrong it is.
    fn refuses(&self, token: &str) -> Option<Response> {
        let differs = (token.bytes().zip(self.token.bytes())).fold(0, |all, (a, b)| all | (a ^ b));
        if token.len() == self.token.len() && differs == 0 {
            return None;
        }
        Some(words(StatusCode::FORBIDDEN, WRONG_TOKEN))
    }
}

type Held = State<Arc<Shared>>;

async fn index(State(shared): Held, Path(token): Path<String>) -> Response {
    page_file(&shared, &token, "")
}

async fn file(State(shared): Held, Path((token, name)): Path<(String, String)>) -> Response {
    page_file(&shared, &token, &name)
}

fn page_file(shared: &Shared, token: &str, name: &str) -> Response {
    if let Some(refused) = shared.refuses(token) {
        return refused;
    }
    match page::file(name) {
        Some((media, content)) => (guarded(media), content).into_response(),
        None => words(StatusCode::NOT_FOUND, NOT_HERE),
    }
}

/// A page of another site that learned the address still gets no socket.
fn same_origin(headers: &HeaderMap) -> bool {
    let text = |name| {
        headers
            .get(name)
            .and_then(|value: &HeaderValue| value.to_str().ok())
    };
    match (text(header::ORIGIN), text(header::HOST)) {
        (None, _) => true,
        (Some(origin), Some(host)) => origin.split_once("://").is_some_and(|(_, from)| from == host),
        (Some(_), None) => false,
    }
}

async fn socket(
    State(shared): Held,
    Path(token): Path<String>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Some(refused) = shared.refuses(&token) {
        return refused;
    }
    if !same_origin(&headers) {
        return words(StatusCode::FORBIDDEN, "Another site's page may not look.");
    }
    upgrade
        .max_message_size(MOST_MESSAGE)
        .max_frame_size(MOST_MESSAGE)
        .on_upgrade(|socket| attend(socket, shared))
}

fn close(code: u16, why: &'static str) -> Sent {
    Sent::Close(Some(CloseFrame {
        code,
        reason: why.into(),
    }))
}

/// Serves one tab until it goes.
async fn attend(mut socket: WebSocket, shared: Arc<Shared>) {
    let Some((tab, outbox)) = shared.desk.enter() else {
        let _ = socket
            .send(close(close_code::AGAIN, "too many tabs are open: close one"))
            .await;
        return;
    };
    outbox.say(shared.desk.hello());
    let mut garbage = 0;
    loop {
        let received = tokio::select! {
            received = socket.recv() => Some(received),
            () = outbox.bell.notified() => None,
            () = sleep(SILENCE) => {
                outbox.bell.notify_one();
                if !sent(&mut socket, Sent::Ping(Bytes::new())).await { break }
                None
            }
        };
        match received {
            Some(Some(Ok(Sent::Text(text)))) => {
                if let Err(what) = heard(&shared.desk, tab, &text) {
                    worker::say_refused(&outbox, None, &what);
                    garbage += 1;
                } else {
                    garbage = 0;
                }
            }
            Some(Some(Ok(Sent::Binary(_)))) => garbage += 1,
            Some(Some(Ok(Sent::Ping(_) | Sent::Pong(_)))) | None => {}
            Some(None | Some(Ok(Sent::Close(_)) | Err(_))) => break,
        }
        if garbage > MOST_GARBAGE {
            let _ = socket
                .send(close(close_code::POLICY, "messages that make no sense"))
                .await;
            break;
        }
        let mut there = true;
        while let Some(words) = outbox.words().filter(|_| there) {
            there = sent(&mut socket, Sent::Text(words.into())).await;
        }
        if let Some(picture) = outbox.picture().filter(|_| there) {
            there = sent(&mut socket, Sent::Binary(picture.into())).await;
        }
        if shared.desk.closed() {
            let _ = socket
                .send(close(close_code::AWAY, "relight view has ended"))
                .await;
            break;
        }
        if !there {
            break;
        }
    }
    shared.desk.leave(tab);
}

/// Sends; whether the tab is still there.
async fn sent(socket: &mut WebSocket, message: Sent) -> bool {
    matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(())))
}

fn heard(desk: &Desk, tab: u64, text: &str) -> Result<(), String> {
    match message(text)? {
        Message::Show(show) => desk.show(tab, *show),
        Message::Pick(pick) => {
            desk.pick(tab, pick);
            Ok(())
        }
    }
}

/// The OpenEXR file of a wish, as `relight play` writes it; `?float` of 32-bit floats.
async fn render(
    State(shared): Held,
    Path(token): Path<String>,
    uri: axum::http::Uri,
    body: Bytes,
) -> Response {
    if let Some(refused) = shared.refuses(&token) {
        return refused;
    }
    let show: Result<Show, _> = serde_json::from_slice(&body);
    let wish = show
        .map_err(|error| format!("not a picture: {error}"))
        .and_then(|show| show.wish(None));
    let wish = match wish {
        Ok(wish) => wish,
        Err(what) => return words(StatusCode::BAD_REQUEST, &what),
    };
    let (answer, file) = oneshot::channel();
    let float = uri.query() == Some("float");
    if let Err(what) = shared.desk.save(Save { wish, float, answer }) {
        return words(StatusCode::TOO_MANY_REQUESTS, &what);
    }
    match file.await {
        Ok(Ok(bytes)) => {
            let mut headers = guarded("image/x-exr");
            headers.insert(
                header::CONTENT_DISPOSITION,
                HeaderValue::from_static("attachment; filename=\"frame.exr\""),
            );
            (headers, bytes).into_response()
        }
        Ok(Err(what)) => words(StatusCode::UNPROCESSABLE_ENTITY, &what),
        Err(_) => words(StatusCode::SERVICE_UNAVAILABLE, "relight view has ended"),
    }
}

/// Takes an environment map; lights may name it from now on.
async fn map(State(shared): Held, Path((token, name)): Path<(String, String)>, body: Bytes) -> Response {
    if let Some(refused) = shared.refuses(&token) {
        return refused;
    }
    let Ok(_one) = shared.decoding.try_acquire() else {
        return words(
            StatusCode::TOO_MANY_REQUESTS,
            "another map is being read: try again in a while",
        );
    };
    let shown_name = name.clone();
    let read = tokio::task::spawn_blocking(move || {
        let limits = Limits {
            max_pixels: MOST_MAP.1,
            max_bytes: 16 * MOST_MAP.1,
            max_file_bytes: MOST_MAP.0 as u64,
        };
        decode_environment(&shown_name, &body, &limits)
    });
    let read = match read.await {
        Ok(Ok(read)) => read,
        Ok(Err(error)) => return words(StatusCode::UNPROCESSABLE_ENTITY, &error.to_string()),
        Err(_) => return words(StatusCode::UNPROCESSABLE_ENTITY, "the map can't be read"),
    };
    let (width, height) = (read.image.width, read.image.height);
    let map = EnvironmentMap {
        width,
        height,
        pixels: read.image.pixels.iter().map(|p| Vec3::from_array(*p)).collect(),
    };
    if let Err(what) = shared.desk.add_map(PathBuf::from(&name), Arc::new(map)) {
        return words(StatusCode::TOO_MANY_REQUESTS, &what);
    }
    let told = json!({ "file": name, "width": width, "height": height, "repaired": read.repaired });
    (guarded("application/json"), told.to_string()).into_response()
}
