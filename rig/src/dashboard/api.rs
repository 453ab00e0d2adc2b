//! The handlers of the addresses.

use super::server::Shared;
use super::{pages, stream};
use crate::live::{self, Ask, Viewer};
use axum::extract::{Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use runs::report::{FIGURES, UPLOT, UPLOT_STYLE};
use serde::Deserialize;
use std::sync::Arc;
use std::time::Duration;

/// Largest body of a request in bytes.
const BODY: usize = 256;
/// Time that a body may take in all.
const BODY_WITHIN: Duration = Duration::from_secs(5);
/// What pages may load and from where: this server, and styles and pictures that stand in a report.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
                      connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The addresses.
pub fn routes(shared: Arc<Shared>) -> Router {
    let data = Router::new()
        .route("/api/about", get(about))
        .route("/api/runs", get(runs))
        .route("/api/runs/{name}/past", get(past))
        .route("/api/runs/{name}/pages/{page}", get(page))
        .route("/api/runs/{name}/ask", post(ask))
        .route("/api/compare", get(compare))
        .route("/api/live/{name}", get(stream::stream))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), with_token));
    Router::new()
        .route("/", get(|| asset("text/html; charset=utf-8", include_str!("assets/index.html"))))
        .route("/app.css", get(|| asset("text/css", include_str!("assets/app.css"))))
        .route("/app.js", get(|| asset("text/javascript", include_str!("assets/app.js"))))
        .route("/plots.js", get(|| asset("text/javascript", FIGURES)))
        .route("/uplot.css", get(|| asset("text/css", UPLOT_STYLE)))
        .route("/uplot.js", get(|| asset("text/javascript", UPLOT)))
        .merge(data)
        .layer(middleware::from_fn(with_body))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), at_this_place))
        .with_state(shared)
}

async fn asset(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text).into_response()
}

/// Before everything else: the right host, and no foreign page; after everything, what a browser is to keep to.
async fn at_this_place(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match shared.guard.place(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(status) => refused(status, &request),
    };
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        response.headers_mut().insert(name, header::HeaderValue::from_static(value));
    }
    response
}

/// Before whatever reads it: a body that is small and whole.
async fn with_body(request: Request, next: Next) -> Response {
    let (head, body) = request.into_parts();
    match tokio::time::timeout(BODY_WITHIN, axum::body::to_bytes(body, BODY)).await {
        Ok(Ok(body)) => next.run(Request::from_parts(head, body.into())).await,
        Ok(Err(_)) => StatusCode::PAYLOAD_TOO_LARGE.into_response(),
        Err(_) => (StatusCode::REQUEST_TIMEOUT, [(header::CONNECTION, "close")]).into_response(),
    }
}

/// Before data: the token.
async fn with_token(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    match shared.guard.token_of(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(status) => refused(status, &request),
    }
}

fn refused(status: StatusCode, request: &Request) -> Response {
    tracing::info!(%status, method = %request.method(), "the dashboard refused a request");
    status.into_response()
}

/// What went wrong, for a page.
fn failed(why: &miette::Report) -> Response {
    (StatusCode::UNPROCESSABLE_ENTITY, format!("{why:#}")).into_response()
}

/// Reads of the disk, beside the streams.
async fn beside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Response> {
    tokio::task::spawn_blocking(work).await.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR.into_response())
}

async fn about(State(shared): State<Arc<Shared>>) -> Response {
    let version = env!("CARGO_PKG_VERSION");
    Json(serde_json::json!({ "version": version, "control": shared.options.control })).into_response()
}

async fn runs(State(shared): State<Arc<Shared>>) -> Result<Response, Response> {
    let found = beside(move || pages::runs(&shared.options.runs)).await?;
    Ok(found.map_or_else(|why| failed(&why), |runs| Json(runs).into_response()))
}

async fn past(State(shared): State<Arc<Shared>>, Path(name): Path<String>) -> Result<Response, Response> {
    let folder = shared.folder(&name).ok_or_else(|| StatusCode::NOT_FOUND.into_response())?;
    let found = beside(move || pages::past(&folder)).await?;
    Ok(found.map_or_else(|why| failed(&why), |messages| Json(messages).into_response()))
}

async fn page(
    State(shared): State<Arc<Shared>>,
    Path((name, page)): Path<(String, String)>,
) -> Result<Response, Response> {
    let folder = shared.folder(&name).ok_or_else(|| StatusCode::NOT_FOUND.into_response())?;
    let found = beside(move || pages::page(&folder, &page)).await?;
    Ok(found.map_or_else(|why| failed(&why), html))
}

/// Two runs.
#[derive(Deserialize)]
struct Two {
    a: String,
    b: String,
}

async fn compare(State(shared): State<Arc<Shared>>, Query(two): Query<Two>) -> Result<Response, Response> {
    let folder = |name: &str| shared.folder(name).ok_or_else(|| StatusCode::NOT_FOUND.into_response());
    let (a, b) = (folder(&two.a)?, folder(&two.b)?);
    let found = beside(move || pages::compare(&a, &b)).await?;
    Ok(found.map_or_else(|why| failed(&why), html))
}

fn html(text: String) -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], text).into_response()
}

/// A request to a run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ControlRequest {
    ask: Ask,
}

async fn ask(
    State(shared): State<Arc<Shared>>,
    Path(name): Path<String>,
    Json(ControlRequest { ask }): Json<ControlRequest>,
) -> Result<StatusCode, Response> {
    shared.guard.count().map_err(IntoResponse::into_response)?;
    if !shared.passes_on(ask) {
        let why = "this dashboard was started without --allow-control: it stops runs, and nothing else";
        return Err((StatusCode::FORBIDDEN, why).into_response());
    }
    let folder = shared.folder(&name).ok_or_else(|| StatusCode::NOT_FOUND.into_response())?;
    let answer = beside(move || match ask {
        // Answered as done only where the run shows it.
        Ask::Stop => live::stop(&folder).map(drop),
        ask => Viewer::connect(&folder)
            .and_then(|viewer| viewer.asking()?(ask))
            .map_err(|why| format!("no request was sent: {why}")),
    });
    answer.await?.map_err(|why| (StatusCode::CONFLICT, why).into_response())?;
    tracing::info!(run = name, ask = ask.word(), "requested from a browser");
    Ok(StatusCode::NO_CONTENT)
}
