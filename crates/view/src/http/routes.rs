//! Which request is answered with what.

use std::sync::Arc;

use hyper::{Method, Request};

use super::answer::{self, Answer};
use super::files;
use super::guard;
use super::query::Query;
use super::state::{MEMORY_UNIT, State};
use crate::Dataset;
use crate::dataset::Work;
use crate::refusal::Refusal;

/// Answers any request.
pub(super) async fn answer<B>(state: Arc<State>, request: Request<B>) -> Answer {
    let answered = match guard::check(&request) {
        Ok(()) => route(&state, &request).await,
        Err(refusal) => Err(refusal),
    };
    let answer = answered.unwrap_or_else(|refusal| {
        if refusal.status >= 500 {
            state.failed(&refusal.line);
        }
        answer::refusal(&refusal, if is_api(&request) { "GET" } else { "GET, HEAD" })
    });
    answer::with_usual_headers(answer)
}

fn is_api<B>(request: &Request<B>) -> bool {
    request.uri().path().starts_with("/api/")
}

async fn route<B>(state: &Arc<State>, request: &Request<B>) -> Result<Answer, Refusal> {
    let absent = || Refusal::absent("there is nothing at this address");
    if is_api(request) && request.method() == Method::HEAD {
        // its points would be decoded to count their bytes
        return Err(Refusal { status: 405, line: "HEAD is for the page and for raw files".to_owned() });
    }
    let path = request.uri().path();
    let mut segments = path.strip_prefix('/').ok_or_else(absent)?.split('/');
    match segments.next() {
        Some("") => page(state).await,
        Some("favicon.ico") => Ok(answer::nothing()),
        Some("api") => {
            let dataset = dataset(state, segments.next())?;
            let (what, more) = (segments.next().ok_or_else(absent)?, segments.next());
            if more.is_some() {
                return Err(absent());
            }
            api(state, dataset, what, &Query::new(request.uri().query())?).await
        }
        Some("data") => {
            let dataset = dataset(state, segments.next())?;
            let names: Vec<String> = segments.map(str::to_owned).collect();
            let find = move || files::find(&dataset, names.iter().map(String::as_str));
            let file = on_thread(state, find).await?;
            files::serve(&file, request.method(), request.headers()).await
        }
        _ => Err(absent()),
    }
}

fn dataset(state: &State, number: Option<&str>) -> Result<Arc<Dataset>, Refusal> {
    let found = number.filter(|n| n.bytes().all(|b| b.is_ascii_digit())).and_then(|n| n.parse::<usize>().ok());
    let found = found.and_then(|number| state.datasets.get(number));
    found.cloned().ok_or_else(|| Refusal::absent("no such dataset"))
}

async fn page(state: &Arc<State>) -> Result<Answer, Refusal> {
    let shared = Arc::clone(state);
    let page = move || shared.page().map_err(|e| Refusal::broken(format!("the page cannot be read: {e}")));
    on_thread(state, page).await.map(answer::html)
}

async fn api(state: &Arc<State>, dataset: Arc<Dataset>, what: &str, query: &Query<'_>) -> Result<Answer, Refusal> {
    match what {
        "scene" => {
            let number = state.datasets.iter().position(|d| Arc::ptr_eq(d, &dataset)).unwrap_or_default();
            let scene = on_thread(state, move || Ok(dataset.scene(number))).await?;
            Ok(answer::json(&scene))
        }
        "nodes" => {
            let of = query.get("of").map(str::to_owned);
            let nodes = on_thread(state, move || dataset.nodes(of.as_deref())).await?;
            Ok(answer::bytes(nodes, None))
        }
        "points" => {
            let request = query.points()?;
            work(state, move || dataset.points(request)).await
        }
        "batches" => {
            let request = query.batches()?;
            work(state, move || dataset.batches(request)).await
        }
        "point" => {
            let (unit, index) = (query.required("unit")?.to_owned(), query.index()?);
            let point = on_thread(state, move || dataset.point(&unit, index)).await?;
            Ok(answer::json(&point))
        }
        _ => Err(Refusal::absent("there is nothing at this address")),
    }
}

/// Makes the bytes of an answer when there is memory for them.
async fn work(state: &State, plan: impl FnOnce() -> Result<Work, Refusal> + Send + 'static) -> Result<Answer, Refusal> {
    let work = on_thread(state, || plan()?.check()).await?;
    let units = u32::try_from(work.cost.div_ceil(MEMORY_UNIT)).unwrap_or(u32::MAX);
    let permit = Arc::clone(&state.memory).acquire_many_owned(units).await.map_err(|_| stopped())?;
    let bytes = on_thread(state, || work.run()).await?;
    Ok(answer::bytes(bytes, Some(permit)))
}

/// Does what may wait for a disk or computes, on a thread for such work.
async fn on_thread<T: Send + 'static>(
    state: &State,
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    let permit = Arc::clone(&state.workers).acquire_owned().await.map_err(|_| stopped())?;
    let done = tokio::task::spawn_blocking(move || {
        let result = work();
        drop(permit);
        result
    });
    done.await.unwrap_or_else(|_| Err(Refusal::broken("internal error while answering a request; please report it")))
}

fn stopped() -> Refusal {
    Refusal::broken("the server is stopping")
}
