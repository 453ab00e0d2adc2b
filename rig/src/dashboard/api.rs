//! The handlers of the addresses.

use super::server::Shared;
use super::{download, foxglove, metrics, pages, stream};
use crate::live::{self, Ask, Viewer};
use axum::extract::{Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use runs::catalogue::Annotations;
use runs::compare::groups::{GroupBy, MOST_COMPARED};
use runs::report::{EXPLORE, FIGURES, UPLOT, UPLOT_STYLE, scoped_style};
use serde::Deserialize;
use std::sync::{Arc, PoisonError};
use std::time::Duration;
use tables::diagnose::diagnose_run;

/// Largest body of a request in bytes.
const BODY: usize = 256;
/// The same of one with tags and a note.
const ANNOTATIONS_BODY: usize = 32 * 1024;
/// Time that a body may take in all.
const BODY_WITHIN: Duration = Duration::from_secs(5);
/// Latest loop time that a window may have, s: a year.
const LONGEST_LOOP_S: f64 = 3.2e7;
/// What pages may load and from where: this server, and styles and pictures that stand in a report.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
                      connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What a handler has of the server.
pub type Server = State<Arc<Shared>>;
/// What it answers: with a text or a document, or by a status alone.
type Answer = Result<Response, Response>;
type Done = Result<StatusCode, Response>;

/// The addresses.
pub fn routes(shared: Arc<Shared>) -> Router {
    let data = Router::new()
        .route("/api/about", get(about))
        .route("/api/runs", get(runs))
        .route("/api/runs/{name}", get(run))
        .route("/api/runs/{name}/report", get(report))
        .route("/api/runs/{name}/cycles", get(cycles))
        .route("/api/runs/{name}/files/{file}", get(file))
        .route("/api/runs/{name}/annotations", post(annotate))
        .route("/api/runs/{name}/diagnose", post(diagnose))
        .route("/api/runs/{name}/pages/{page}", get(page))
        .route("/api/runs/{name}/ask", post(ask))
        .route("/api/compare", get(compare))
        .route("/api/live/{name}", get(stream::stream))
        .route("/foxglove", get(foxglove::newest))
        .route("/foxglove/{name}", get(foxglove::one))
        .route("/metrics", get(metrics::metrics))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), with_token));
    Router::new()
        .route("/", get(|| asset("text/html; charset=utf-8", include_str!("assets/index.html"))))
        .route("/app.css", get(|| asset("text/css", include_str!("assets/app.css"))))
        .route("/app.js", get(|| asset("text/javascript", include_str!("assets/app.js"))))
        .route("/plots.js", get(|| asset("text/javascript", FIGURES)))
        .route("/explore.js", get(|| asset("text/javascript", EXPLORE)))
        .route("/report.css", get(|| async { asset("text/css", &scoped_style(".report")).await }))
        .route("/uplot.css", get(|| asset("text/css", UPLOT_STYLE)))
        .route("/uplot.js", get(|| asset("text/javascript", UPLOT)))
        .merge(data)
        .layer(middleware::from_fn(with_body))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), at_this_place))
        .with_state(shared)
}

async fn asset(kind: &'static str, text: &str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text.to_string()).into_response()
}

/// Before everything else: the right host, and no foreign page; after everything, what a browser is to keep to.
async fn at_this_place(State(shared): Server, request: Request, next: Next) -> Response {
    let stream = request.uri().path().starts_with("/foxglove");
    let mut response = match shared.guard.place(request.headers(), stream) {
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
    let most = if head.uri.path().ends_with("/annotations") { ANNOTATIONS_BODY } else { BODY };
    match tokio::time::timeout(BODY_WITHIN, axum::body::to_bytes(body, most)).await {
        Ok(Ok(body)) => next.run(Request::from_parts(head, body.into())).await,
        Ok(Err(_)) => StatusCode::PAYLOAD_TOO_LARGE.into_response(),
        Err(_) => (StatusCode::REQUEST_TIMEOUT, [(header::CONNECTION, "close")]).into_response(),
    }
}

/// Before data: the token.
async fn with_token(State(shared): Server, request: Request, next: Next) -> Response {
    // Foxglove has an address alone to give, and Prometheus may have a header or an address.
    let uri = request.uri();
    let programs = uri.path() == "/metrics" || uri.path().starts_with("/foxglove");
    match shared.guard.token_of(request.headers(), uri.query().filter(|_| programs)) {
        Ok(()) => next.run(request).await,
        Err(status) => refused(status, &request),
    }
}

fn refused(status: StatusCode, request: &Request) -> Response {
    let origin = request.headers().get(header::ORIGIN);
    tracing::info!(%status, method = %request.method(), ?origin, "the dashboard refused a request");
    status.into_response()
}

/// What went wrong, for a page.
fn failed_to(why: &miette::Report) -> Response {
    (StatusCode::UNPROCESSABLE_ENTITY, format!("{why:#}")).into_response()
}

/// Reads of the disk, beside the streams.
pub async fn beside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Response> {
    tokio::task::spawn_blocking(work).await.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR.into_response())
}

async fn about(State(shared): Server) -> Response {
    let version = env!("CARGO_PKG_VERSION");
    Json(serde_json::json!({ "version": version, "control": shared.options.control })).into_response()
}

async fn runs(State(shared): Server) -> Answer {
    let found = beside(move || pages::runs(&shared.options.runs)).await?;
    Ok(found.map_or_else(|why| failed_to(&why), |runs| Json(runs).into_response()))
}

/// Folder of a run, or the answer that there is none.
fn folder(shared: &Shared, name: &str) -> Result<std::path::PathBuf, Response> {
    shared.folder(name).ok_or_else(|| StatusCode::NOT_FOUND.into_response())
}

async fn run(State(shared): Server, Path(name): Path<String>) -> Answer {
    folder(&shared, &name)?;
    let (diagnosing, failed) = {
        let diagnoses = shared.diagnoses.lock().unwrap_or_else(PoisonError::into_inner);
        (diagnoses.under_way.as_ref() == Some(&name), diagnoses.failed.get(&name).cloned())
    };
    let found = beside(move || pages::run(&shared.options.runs, &name)).await?;
    let answer = |run| serde_json::json!({ "run": run, "diagnosing": diagnosing, "undiagnosed": failed });
    Ok(found.map_or_else(|why| failed_to(&why), |run| Json(answer(run)).into_response()))
}

async fn report(State(shared): Server, Path(name): Path<String>) -> Answer {
    let folder = folder(&shared, &name)?;
    let found = beside(move || runs::report::html(&folder, &[], None)).await?;
    Ok(found.map_or_else(|why| failed_to(&why), |(page, _)| html(page)))
}

/// A window of a run's loop time, s.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WindowS {
    from_s: f64,
    to_s: f64,
}

/// The recorded cycles of a window, as finely as a screen shows them. One window is read at a time: the
/// record of hours is long.
async fn cycles(State(shared): Server, Path(name): Path<String>, Query(window): Query<WindowS>) -> Answer {
    let WindowS { from_s, to_s } = window;
    let folder = folder(&shared, &name)?;
    if !(0.0..=LONGEST_LOOP_S).contains(&from_s) || !(from_s..=LONGEST_LOOP_S).contains(&to_s) {
        let why = "a window from from_s to to_s is needed, in s of loop time, the first not after the second";
        return Err((StatusCode::UNPROCESSABLE_ENTITY, why).into_response());
    }
    let _turn =
        shared.windows.acquire().await.map_err(|_| StatusCode::SERVICE_UNAVAILABLE.into_response())?;
    let found = beside(move || runs::report::traces::within(&folder, [from_s, to_s])).await?;
    Ok(found.map_or_else(|why| failed_to(&why), |window| Json(window).into_response()))
}

async fn file(State(shared): Server, Path((name, file)): Path<(String, String)>) -> Answer {
    let folder = folder(&shared, &name)?;
    let found = beside(move || download::file(&folder, &file)).await?;
    found.ok_or_else(|| StatusCode::NOT_FOUND.into_response())
}

async fn annotate(State(shared): Server, Path(name): Path<String>, Json(new): Json<Annotations>) -> Done {
    shared.guard.count().map_err(IntoResponse::into_response)?;
    let folder = folder(&shared, &name)?;
    beside(move || new.write(&folder)).await?.map_err(|why| failed_to(&why))?;
    Ok(StatusCode::NO_CONTENT)
}

/// Begins a diagnosis beside everything else. While any run of the folder goes on there is none: it
/// would take that loop's processor.
async fn diagnose(State(shared): Server, Path(name): Path<String>) -> Done {
    shared.guard.count().map_err(IntoResponse::into_response)?;
    let folder = folder(&shared, &name)?;
    let refused = |why: &str| (StatusCode::CONFLICT, why.to_string()).into_response();
    let runs = shared.options.runs.clone();
    if beside(move || !pages::live(&runs).is_empty()).await? {
        return Err(refused("a run goes on: diagnose when it is over"));
    }
    {
        let mut diagnoses = shared.diagnoses.lock().unwrap_or_else(PoisonError::into_inner);
        if diagnoses.under_way.is_some() {
            return Err(refused("another diagnosis is under way"));
        }
        diagnoses.failed.remove(&name);
        diagnoses.under_way = Some(name.clone());
    }
    tokio::task::spawn_blocking(move || {
        let found = std::panic::catch_unwind(|| diagnose_run(&folder));
        let mut diagnoses = shared.diagnoses.lock().unwrap_or_else(PoisonError::into_inner);
        diagnoses.under_way = None;
        let why = match found {
            Ok(Ok(())) => return,
            Ok(Err(why)) => format!("{why:#}"),
            Err(_) => "the diagnosis failed; `muprime diagnose` on this folder shows why".into(),
        };
        diagnoses.failed.insert(name, why);
    });
    Ok(StatusCode::ACCEPTED)
}

async fn page(State(shared): Server, Path((name, page)): Path<(String, String)>) -> Answer {
    let folder = folder(&shared, &name)?;
    let found = beside(move || pages::page(&folder, &page)).await?;
    Ok(found.map_or_else(|why| failed_to(&why), html))
}

/// Runs to compare.
#[derive(Deserialize)]
struct Several {
    /// Their names, between slashes: no name has one.
    runs: String,
    /// What more than two are grouped by.
    by: Option<GroupBy>,
}

async fn compare(State(shared): Server, Query(several): Query<Several>) -> Answer {
    let names = several.runs.split('/');
    let folders = names.map(|name| folder(&shared, name)).collect::<Result<Vec<_>, _>>()?;
    if !(2..=MOST_COMPARED).contains(&folders.len()) {
        let why = format!("2 to {MOST_COMPARED} runs are compared");
        return Err((StatusCode::UNPROCESSABLE_ENTITY, why).into_response());
    }
    let found = beside(move || pages::compare(&folders, several.by)).await?;
    Ok(found.map_or_else(|why| failed_to(&why), html))
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

async fn ask(State(shared): Server, Path(name): Path<String>, Json(request): Json<ControlRequest>) -> Done {
    let ControlRequest { ask } = request;
    shared.guard.count().map_err(IntoResponse::into_response)?;
    if ask != Ask::Stop && !shared.options.control {
        let why = "this dashboard was started without --allow-control: it stops runs, and nothing else";
        return Err((StatusCode::FORBIDDEN, why).into_response());
    }
    let folder = folder(&shared, &name)?;
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
