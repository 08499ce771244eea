//! What can be asked for, behind the key. Nothing of a request's path ever reaches the file system: pages and figures come
//! from memory.

use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use minijinja::{Environment, context};
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::sync::Semaphore;

use super::desk::Desk;
use super::guard::Guard;
use super::refusal::Refusal;
use super::subject::{Entrance, EntranceRequest, PageOrder, PageScene, PageSubject, Parcel, Reply};
use crate::{Error, Result};

const HTML: &str = "text/html; charset=utf-8";
/// An order is a line of text.
const LARGEST_ORDER: usize = 16 * 1024;
/// What is asked of the entrance: every cell of a list of cuts.
const LARGEST_REQUEST: usize = 4 << 20;
/// A file that is dropped on the page, with the line that names it.
const LARGEST_FILE: usize = 256 << 20;
/// In which a request must be read and answered.
const PATIENCE: Duration = Duration::from_secs(300);
/// In which the body of an order must be there.
const BODY: Duration = Duration::from_secs(10);

/// The page: its own style and script, its own server, and nothing else.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                           connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; \
                           frame-ancestors 'none'";
/// The report carries its styles and scripts in itself. It may ask for nothing from anywhere, and its scripts run
/// without an origin: they cannot reach the page around them, nor the secrets in it.
const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                             img-src 'self' data: blob:; font-src data:; base-uri 'none'; form-action 'none'; \
                             frame-ancestors 'self'; sandbox allow-scripts allow-downloads allow-popups";

/// What the page is about at the moment.
pub struct PageStand {
    entrance: Option<Arc<dyn Entrance>>,
    bench: RwLock<Option<Arc<dyn PageSubject>>>,
}

impl PageStand {
    pub fn bench(&self) -> Option<Arc<dyn PageSubject>> {
        self.bench.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn is_now_about(&self, bench: Option<Arc<dyn PageSubject>>) {
        *self.bench.write().unwrap_or_else(PoisonError::into_inner) = bench;
    }
}

struct App {
    stand: Arc<PageStand>,
    desk: Arc<Desk>,
    guard: Guard,
    /// Large files are held in memory: one at a time.
    parcels: Semaphore,
    /// Names this run of the server: a page that another one made knows that it is old.
    session: String,
}

pub fn router(scene: PageScene, guard: Guard) -> (Router, Arc<PageStand>) {
    let (entrance, bench) = match scene {
        PageScene::Bench(bench) => (None, Some(bench)),
        PageScene::Entrance(entrance) => (Some(entrance), None),
    };
    let stand = Arc::new(PageStand {
        entrance,
        bench: RwLock::new(bench),
    });
    let app = Arc::new(App {
        stand: stand.clone(),
        desk: Arc::new(Desk::default()),
        guard,
        parcels: Semaphore::new(1),
        session: format!("{:016x}", rand::random::<u64>()),
    });
    let router = Router::new()
        .route("/{key}/", get(page))
        .route(
            "/{key}/page.css",
            get(|| text("text/css", include_str!("page.css"))),
        )
        .route("/{key}/page.js", script(include_str!("page.js")))
        .route("/{key}/begin.js", script(include_str!("begin.js")))
        .route("/{key}/state", get(state))
        .route("/{key}/status", get(status))
        .route("/{key}/order", post(order))
        .route("/{key}/cancel", post(cancel))
        .route(
            "/{key}/begin",
            post(begin).layer(DefaultBodyLimit::max(LARGEST_REQUEST)),
        )
        .route("/{key}/upload", post(upload))
        .route("/{key}/report", get(report))
        .route("/{key}/report/{name}", get(figure))
        .fallback(|| async { (StatusCode::NOT_FOUND, "there is no such page\n") })
        .layer(DefaultBodyLimit::max(LARGEST_ORDER))
        .layer(middleware::from_fn_with_state(app.clone(), guarded))
        .with_state(app);
    (router, stand)
}

fn script(script: &'static str) -> axum::routing::MethodRouter<Arc<App>> {
    get(move || text("text/javascript", script))
}

/// Every request passes here first, every answer last.
async fn guarded(State(app): State<Arc<App>>, request: axum::extract::Request, next: Next) -> Response {
    let mut response = match app
        .guard
        .check(request.method(), request.uri(), request.headers())
    {
        Ok(()) => {
            let answer = async {
                match whole(request).await {
                    Ok(request) => next.run(request).await,
                    Err(refused) => refused,
                }
            };
            match tokio::time::timeout(PATIENCE, answer).await {
                Ok(response) => response,
                Err(_) => too_slow(),
            }
        }
        // Whoever has no business here takes no place either.
        Err(why) => (
            StatusCode::FORBIDDEN,
            [(header::CONNECTION, "close")],
            format!("{why}\n"),
        )
            .into_response(),
    };
    let headers = response.headers_mut();
    headers
        .entry(header::CONTENT_SECURITY_POLICY)
        .or_insert(HeaderValue::from_static(PAGE_POLICY));
    for (name, value) in [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "same-origin"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    for (name, value) in [
        ("cross-origin-resource-policy", "same-origin"),
        ("cross-origin-opener-policy", "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// A request whose body is there; files that are dropped on the page alone come in their own time.
async fn whole(request: axum::extract::Request) -> std::result::Result<axum::extract::Request, Response> {
    if request.uri().path().ends_with("/upload") {
        return Ok(request);
    }
    let (head, body) = request.into_parts();
    match tokio::time::timeout(BODY, axum::body::to_bytes(body, LARGEST_REQUEST)).await {
        Ok(Ok(bytes)) => Ok(axum::extract::Request::from_parts(head, bytes.into())),
        Ok(Err(_)) => Err(refuse(
            StatusCode::PAYLOAD_TOO_LARGE,
            "the request is too large, or it was cut off",
        )),
        Err(_) => Err(too_slow()),
    }
}

fn too_slow() -> Response {
    let close = [(header::CONNECTION, "close")];
    (StatusCode::REQUEST_TIMEOUT, close, "that took too long\n").into_response()
}

async fn text(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, format!("{kind}; charset=utf-8"))], text).into_response()
}

async fn page(State(app): State<Arc<App>>) -> Response {
    let render = || -> std::result::Result<String, minijinja::Error> {
        let mut engine = Environment::new();
        engine.add_template("page.html", include_str!("page.html"))?;
        engine.get_template("page.html")?.render(context! {
            title => app.stand.bench().map_or_else(|| "New campaign".to_string(), |bench| bench.title()),
            token => app.guard.token(),
            report => app.guard.report(),
            session => app.session.as_str(),
            version => env!("CARGO_PKG_VERSION"),
        })
    };
    match render() {
        Ok(html) => ([(header::CONTENT_TYPE, HTML)], html).into_response(),
        Err(error) => failed(Error::computation(format!("page template: {error:#}"))),
    }
}

fn failed(error: Error) -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response()
}

/// Work with files, off the thread that answers.
async fn off_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T> {
    let failed = |_| Error::computation("the program failed at this: a fault of its own");
    tokio::task::spawn_blocking(work).await.map_err(failed)
}

/// `{"begin": true}` where the page is about no campaign yet, `{"problem": …}` where it cannot be read. `can_leave`: there is
/// a way back to the beginning.
async fn state(State(app): State<Arc<App>>) -> Response {
    let Some(bench) = app.stand.bench() else {
        return Json(json!({ "begin": true })).into_response();
    };
    let can_leave = app.stand.entrance.is_some();
    match off_thread(move || bench.state()).await {
        Ok(Ok(mut state)) => {
            state["can_leave"] = json!(can_leave);
            Json(state).into_response()
        }
        Ok(Err(error)) => {
            Json(json!({ "problem": error.to_string(), "can_leave": can_leave })).into_response()
        }
        Err(error) => failed(error),
    }
}

async fn status(State(app): State<Arc<App>>) -> Response {
    let bench = app.stand.bench();
    match off_thread(move || bench.map_or_else(String::new, |bench| bench.stamp())).await {
        Ok(stamp) => {
            let mut status = app.desk.status();
            status["stamp"] = json!(stamp);
            status["session"] = json!(app.session);
            Json(status).into_response()
        }
        Err(error) => failed(error),
    }
}

fn refuse(status: StatusCode, why: impl Into<String>) -> Response {
    (status, Json(json!({ "refused": why.into() }))).into_response()
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        match self {
            Refusal::Late(why) => refuse(StatusCode::CONFLICT, why),
            Refusal::Impossible(why) => refuse(StatusCode::UNPROCESSABLE_ENTITY, why),
        }
    }
}

fn read<T: for<'a> Deserialize<'a>>(body: &[u8], what: &str) -> std::result::Result<T, Box<Response>> {
    serde_json::from_slice(body)
        .map_err(|error| Box::new(refuse(StatusCode::BAD_REQUEST, format!("no {what}: {error}"))))
}

const NO_ENTRANCE: &str = "this page was started for one campaign; start `lobestone serve` without a folder";

async fn order(State(app): State<Arc<App>>, body: Bytes) -> Response {
    let order: PageOrder = match read(&body, "order") {
        Ok(order) => order,
        Err(response) => return *response,
    };
    let Some(bench) = app.stand.bench() else {
        return Refusal::Impossible("no campaign is open yet".into()).into_response();
    };
    match off_thread(move || app.desk.start(|| bench.prepare(order))).await {
        Ok(Ok(number)) => (StatusCode::ACCEPTED, Json(json!({ "number": number }))).into_response(),
        Ok(Err(refusal)) => refusal.into_response(),
        Err(error) => failed(error),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cancel {
    /// As `/status` tells it.
    number: u64,
}

async fn cancel(State(app): State<Arc<App>>, body: Bytes) -> Response {
    let Cancel { number } = match read(&body, "job") {
        Ok(cancel) => cancel,
        Err(response) => return *response,
    };
    match off_thread(move || app.desk.cancel(number)).await {
        Ok(Ok(())) => Json(json!({ "cancelled": number })).into_response(),
        Ok(Err(refusal)) => refusal.into_response(),
        Err(error) => failed(error),
    }
}

async fn begin(State(app): State<Arc<App>>, body: Bytes) -> Response {
    let request: EntranceRequest = match read(&body, "request") {
        Ok(request) => request,
        Err(response) => return *response,
    };
    let done = off_thread(move || -> std::result::Result<Value, Refusal> {
        let Some(entrance) = &app.stand.entrance else {
            return Err(Refusal::Impossible(NO_ENTRANCE.into()));
        };
        let about =
            |bench: Option<Arc<dyn PageSubject>>| app.desk.while_idle(|| app.stand.is_now_about(bench));
        match entrance.answer(request)? {
            Reply::Told(told) => return Ok(told),
            Reply::Opened(bench) => about(Some(bench))?,
            Reply::Left => about(None)?,
        }
        Ok(json!({ "done": true }))
    });
    match done.await {
        Ok(Ok(told)) => Json(told).into_response(),
        Ok(Err(refusal)) => refusal.into_response(),
        Err(error) => failed(error),
    }
}

/// A line of JSON, a [`Parcel`], and behind it the file.
async fn upload(State(app): State<Arc<App>>, request: axum::extract::Request) -> Response {
    let Some(entrance) = app.stand.entrance.clone() else {
        return Refusal::Impossible(NO_ENTRANCE.into()).into_response();
    };
    let too_large = || {
        let why = format!(
            "a file may be {} MB large; copy it into the folder yourself",
            LARGEST_FILE >> 20
        );
        refuse(StatusCode::PAYLOAD_TOO_LARGE, why)
    };
    let length = request
        .headers()
        .get(header::CONTENT_LENGTH)
        .and_then(|v| v.to_str().ok()?.parse().ok());
    if length.is_some_and(|length: u64| length > LARGEST_FILE as u64) {
        return too_large();
    }
    // The semaphore is never closed.
    let _one = app.parcels.acquire().await;
    let Ok(body) = axum::body::to_bytes(request.into_body(), LARGEST_FILE).await else {
        return too_large();
    };
    let Some(end) = body.iter().take(LARGEST_ORDER).position(|b| *b == b'\n') else {
        return refuse(StatusCode::BAD_REQUEST, "no line that names the file");
    };
    let parcel: Parcel = match read(&body[..end], "name of a file") {
        Ok(parcel) => parcel,
        Err(response) => return *response,
    };
    match off_thread(move || entrance.receive(&parcel, &body[end + 1..])).await {
        Ok(Ok(())) => Json(json!({ "received": true })).into_response(),
        Ok(Err(error)) => Refusal::from(error).into_response(),
        Err(error) => failed(error),
    }
}

async fn report(State(app): State<Arc<App>>) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HTML),
        (header::CONTENT_SECURITY_POLICY, REPORT_POLICY),
    ];
    match app.stand.bench().and_then(|bench| bench.report()) {
        Some(report) => (headers, report.html.clone()).into_response(),
        None => (StatusCode::NOT_FOUND, headers, "<p>No report was drawn yet.</p>").into_response(),
    }
}

async fn figure(State(app): State<Arc<App>>, Path((_key, name)): Path<(String, String)>) -> Response {
    let report = app.stand.bench().and_then(|bench| bench.report());
    match report.as_ref().and_then(|r| r.images.get(&name)) {
        Some(png) => ([(header::CONTENT_TYPE, "image/png")], png.clone()).into_response(),
        None => (StatusCode::NOT_FOUND, "the report has no such figure\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(text: &str) -> std::result::Result<PageOrder, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn orders_are_read_strictly() {
        use crate::revision::Side;
        assert_eq!(
            order(r#"{"do": "add", "side": "cutting", "head": "0-0", "effect": "runout"}"#),
            Ok(PageOrder::Add {
                side: Side::Cutting,
                head: "0-0".into(),
                effect: "runout".into()
            })
        );
        assert_eq!(order(r#"{"do": "refresh"}"#), Ok(PageOrder::Refresh {}));
        for wrong in [
            r#"{"do": "delete"}"#,
            r#"{"do": "add", "side": "cutting", "effect": "runout"}"#,
            r#"{"do": "undo", "side": "both", "head": "0-0"}"#,
            r#"{"do": "refresh", "dir": "/etc"}"#,
            r#"{}"#,
            r#"[]"#,
        ] {
            assert!(order(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_page_is_whole() {
        for name in ["page.css", "page.js", "begin.js"] {
            assert!(
                include_str!("page.html").contains(&format!("\"{name}\"")),
                "{name}"
            );
        }
        for outside in ["http://", "https://", "//cdn", "@import", "url("] {
            for text in [
                include_str!("page.html"),
                include_str!("page.css"),
                include_str!("page.js"),
                include_str!("begin.js"),
            ] {
                let own = text.replace("http://www.w3.org/2000/svg", "");
                assert!(!own.contains(outside), "{outside}");
            }
        }
    }
}
