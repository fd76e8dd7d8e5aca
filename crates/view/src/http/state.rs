//! What all requests share.

use std::sync::Arc;

use serde_json::{Value, json};
use tokio::sync::Semaphore;

use crate::{Dataset, PageSource};

/// What happens while datasets are served, for a line in a terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A request could not be answered because a dataset, or the page, is broken. One line.
    Failed(String),
}

/// Who is informed of events; called on any thread.
pub type Events = dyn Fn(Event) + Send + Sync;

/// How datasets are served.
#[derive(Clone, Default)]
#[non_exhaustive]
pub struct Options {
    /// The port; 0 is any that is free.
    pub port: u16,
    /// Threads that decode points; 0 is one per core.
    pub threads: usize,
    /// Where the page comes from.
    pub page: PageSource,
    /// Who is informed of events.
    pub events: Option<Arc<Events>>,
}

impl Options {
    /// On that port.
    #[must_use]
    pub fn port(mut self, port: u16) -> Self {
        self.port = port;
        self
    }

    /// Decoding on so many threads.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// With the page of a folder.
    #[must_use]
    pub fn page(mut self, page: PageSource) -> Self {
        self.page = page;
        self
    }

    /// Informing `events`.
    #[must_use]
    pub fn events(mut self, events: impl Fn(Event) + Send + Sync + 'static) -> Self {
        self.events = Some(Arc::new(events));
        self
    }

    pub(super) fn threads_or_cores(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n,
        }
    }
}

impl std::fmt::Debug for Options {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Options").field("port", &self.port).field("page", &self.page).finish_non_exhaustive()
    }
}

/// Bytes of answers that are in memory at a time, in units of [`MEMORY_UNIT`]: twice the most that one may have.
const MEMORY_UNITS: usize = 512;

/// See [`MEMORY_UNITS`].
pub(super) const MEMORY_UNIT: u64 = 1 << 20;

/// What all requests share.
pub(super) struct State {
    pub(super) datasets: Vec<Arc<Dataset>>,
    page: PageSource,
    events: Option<Arc<Events>>,
    /// One permit for each thread that may decode.
    pub(super) workers: Arc<Semaphore>,
    /// One permit for each [`MEMORY_UNIT`] of answers.
    pub(super) memory: Arc<Semaphore>,
}

impl State {
    pub(super) fn new(datasets: Vec<Dataset>, options: &Options) -> Self {
        Self {
            datasets: datasets.into_iter().map(Arc::new).collect(),
            page: options.page.clone(),
            events: options.events.clone(),
            workers: Arc::new(Semaphore::new(options.threads_or_cores())),
            memory: Arc::new(Semaphore::new(MEMORY_UNITS)),
        }
    }

    pub(super) fn page(&self) -> std::io::Result<String> {
        let scenes: Vec<String> = (0..self.datasets.len()).map(|number| format!("api/{number}")).collect();
        let config: Value = json!({ "mode": "server", "scenes": scenes, "version": env!("CARGO_PKG_VERSION") });
        self.page.page(&config)
    }

    pub(super) fn failed(&self, line: &str) {
        if let Some(events) = &self.events {
            events(Event::Failed(line.to_owned()));
        }
    }
}
