//! What can be asked for. Nothing of a request's path ever reaches the file system: pages and figures come from memory.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use minijinja::{Environment, context};
use serde_json::json;

use super::desk::Desk;
use super::guard::Guard;
use super::{Order, Refusal, Workbench};
use crate::{Error, Result};

const HTML: &str = "text/html; charset=utf-8";
/// An order is a line of text.
const LARGEST_ORDER: usize = 16 * 1024;

/// The page: its own style and script, its own server, and nothing else.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                           connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; \
                           frame-ancestors 'none'";
/// The report carries its styles and scripts in itself. It may ask for nothing from anywhere, and its scripts run
/// without an origin: they cannot reach the page around them, nor the secret in it.
const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                             img-src 'self' data: blob:; font-src data:; base-uri 'none'; form-action 'none'; \
                             frame-ancestors 'self'; sandbox allow-scripts allow-downloads allow-popups";

struct App {
    bench: Arc<dyn Workbench>,
    desk: Arc<Desk>,
    guard: Guard,
    /// Names this run of the server: a page that another one made knows that it is old.
    session: String,
}

pub fn router(bench: Arc<dyn Workbench>, address: SocketAddr) -> Router {
    let app = Arc::new(App {
        bench,
        desk: Arc::new(Desk::default()),
        guard: Guard::new(address),
        session: format!("{:016x}", rand::random::<u64>()),
    });
    Router::new()
        .route("/", get(page))
        .route("/page.css", get(|| text("text/css", include_str!("page.css"))))
        .route(
            "/page.js",
            get(|| text("text/javascript", include_str!("page.js"))),
        )
        .route("/state", get(state))
        .route("/status", get(status))
        .route("/order", post(order))
        .route("/report", get(report))
        .route("/report/{name}", get(figure))
        .fallback(|| async { (StatusCode::NOT_FOUND, "there is no such page\n") })
        .layer(DefaultBodyLimit::max(LARGEST_ORDER))
        .layer(middleware::from_fn_with_state(app.clone(), guarded))
        .with_state(app)
}

/// Every request passes here first, every answer last.
async fn guarded(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let mut response = match app
        .guard
        .check(request.method(), request.uri(), request.headers())
    {
        Ok(()) => next.run(request).await,
        Err(why) => (StatusCode::FORBIDDEN, format!("{why}\n")).into_response(),
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

async fn text(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, format!("{kind}; charset=utf-8"))], text).into_response()
}

async fn page(State(app): State<Arc<App>>) -> Response {
    let render = || -> std::result::Result<String, minijinja::Error> {
        let mut engine = Environment::new();
        engine.add_template("page.html", include_str!("page.html"))?;
        engine.get_template("page.html")?.render(context! {
            title => app.bench.title(),
            token => app.guard.token(),
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

/// `{"problem": …}` where the campaign cannot be read.
async fn state(State(app): State<Arc<App>>) -> Response {
    let bench = app.bench.clone();
    match off_thread(move || bench.state()).await {
        Ok(Ok(state)) => Json(state).into_response(),
        Ok(Err(error)) => Json(json!({ "problem": error.to_string() })).into_response(),
        Err(error) => failed(error),
    }
}

async fn status(State(app): State<Arc<App>>) -> Response {
    let bench = app.bench.clone();
    match off_thread(move || bench.stamp()).await {
        Ok(stamp) => {
            let mut status = app.desk.status();
            status["stamp"] = json!(stamp);
            status["session"] = json!(app.session);
            Json(status).into_response()
        }
        Err(error) => failed(error),
    }
}

async fn order(State(app): State<Arc<App>>, body: Bytes) -> Response {
    let refuse = |status, why: String| (status, Json(json!({ "refused": why }))).into_response();
    let order: Order = match serde_json::from_slice(&body) {
        Ok(order) => order,
        Err(error) => return refuse(StatusCode::BAD_REQUEST, format!("no order: {error}")),
    };
    let taken = off_thread(move || app.desk.start(|| app.bench.clone().prepare(order))).await;
    match taken {
        Ok(Ok(number)) => (StatusCode::ACCEPTED, Json(json!({ "number": number }))).into_response(),
        Ok(Err(Refusal::Late(why))) => refuse(StatusCode::CONFLICT, why),
        Ok(Err(Refusal::Impossible(why))) => refuse(StatusCode::UNPROCESSABLE_ENTITY, why),
        Err(error) => failed(error),
    }
}

async fn report(State(app): State<Arc<App>>) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HTML),
        (header::CONTENT_SECURITY_POLICY, REPORT_POLICY),
    ];
    match app.bench.report() {
        Some(report) => (headers, report.html.clone()).into_response(),
        None => (StatusCode::NOT_FOUND, headers, "<p>No report was drawn yet.</p>").into_response(),
    }
}

async fn figure(State(app): State<Arc<App>>, Path(name): Path<String>) -> Response {
    let report = app.bench.report();
    match report.as_ref().and_then(|r| r.images.get(&name)) {
        Some(png) => ([(header::CONTENT_TYPE, "image/png")], png.clone()).into_response(),
        None => (StatusCode::NOT_FOUND, "the report has no such figure\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> std::result::Result<Order, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn orders_are_read_strictly() {
        use crate::revision::Domain;
        assert_eq!(
            read(r#"{"do": "add", "side": "cutting", "head": "0-0", "effect": "runout"}"#),
            Ok(Order::Add {
                side: Domain::Cutting,
                head: "0-0".into(),
                effect: "runout".into()
            })
        );
        assert_eq!(read(r#"{"do": "refresh"}"#), Ok(Order::Refresh {}));
        for wrong in [
            r#"{"do": "delete"}"#,
            r#"{"do": "add", "side": "cutting", "effect": "runout"}"#,
            r#"{"do": "undo", "side": "both", "head": "0-0"}"#,
            r#"{"do": "refresh", "dir": "/etc"}"#,
            r#"{}"#,
            r#"[]"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_page_is_whole() {
        for name in ["page.css", "page.js"] {
            assert!(include_str!("page.html").contains(&format!("/{name}")), "{name}");
        }
        for outside in ["http://", "https://", "//cdn", "@import", "url("] {
            for text in [
                include_str!("page.html"),
                include_str!("page.css"),
                include_str!("page.js"),
            ] {
                let own = text.replace("http://www.w3.org/2000/svg", "");
                assert!(!own.contains(outside), "{outside}");
            }
        }
    }
}
