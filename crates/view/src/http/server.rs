//! Connections: how many, for how long, and their end.

use std::convert::Infallible;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};

use super::patience::Patient;
use super::routes;
use super::state::{Options, State};
use crate::{Dataset, ViewError};

/// Connections at a time; others wait to be accepted.
const CONNECTIONS: usize = 256;

/// A request's head has this long to arrive, and a connection may rest as long between two.
const PATIENCE: Duration = Duration::from_secs(15);

/// A client that reads nothing of an answer for so long is given up.
const WRITE_PATIENCE: Duration = Duration::from_secs(60);

/// How often it is asked whether to stop.
const TICK: Duration = Duration::from_millis(50);

/// Answers that are under way when the server stops have this long.
const GRACE: Duration = Duration::from_millis(300);

/// Threads that read raw files, beside those that decode.
const FILE_THREADS: usize = 4;

/// A server that listens on the loopback interface of this machine.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    options: Options,
}

impl Server {
    /// Takes the port; answers begin with [`Self::run`].
    ///
    /// # Errors
    /// A port that is taken, or may not be used.
    pub fn bind(options: Options) -> Result<Self, ViewError> {
        let listen = || {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, options.port))?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) = listen().map_err(|error| ViewError::Listen { port: options.port, error })?;
        Ok(Self { listener, address, options })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of the page, for a browser.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Answers requests for these datasets until `should_stop` says so, which is asked twenty times a second.
    ///
    /// # Errors
    /// No threads.
    pub fn run(self, datasets: Vec<Dataset>, should_stop: impl Fn() -> bool) -> Result<(), ViewError> {
        let threads = self.options.threads_or_cores();
        let state = Arc::new(State::new(datasets, &self.options));
        let system = |what: &str| {
            let what = what.to_owned();
            move |error| ViewError::System { what, error }
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(threads.min(2))
            .max_blocking_threads(threads + FILE_THREADS)
            .thread_name("pointmill-view")
            .enable_io()
            .enable_time()
            .build()
            .map_err(system("starting threads"))?;
        let result = runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener).map_err(system("listening"))?;
            accept(&listener, &state, should_stop).await;
            Ok(())
        });
        runtime.shutdown_timeout(TICK);
        result
    }
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server").field("address", &self.address).finish_non_exhaustive()
    }
}

async fn accept(listener: &tokio::net::TcpListener, state: &Arc<State>, should_stop: impl Fn() -> bool) {
    let (places, graceful) = (Arc::new(Semaphore::new(CONNECTIONS)), GracefulShutdown::new());
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
    while !should_stop() {
        let Ok(Ok(place)) = timeout(TICK, Arc::clone(&places).acquire_owned()).await else { continue };
        let stream = match timeout(TICK, listener.accept()).await {
            Ok(Ok((stream, _))) => stream,
            // no files left, or a client that has gone already
            Ok(Err(_)) => {
                sleep(TICK).await;
                continue;
            }
            Err(_) => continue,
        };
        let _ = stream.set_nodelay(true);
        let state = Arc::clone(state);
        let service = service_fn(move |request| {
            let state = Arc::clone(&state);
            async move { Ok::<_, Infallible>(routes::answer(state, request).await) }
        });
        let connection =
            graceful.watch(http.serve_connection(TokioIo::new(Patient::new(stream, WRITE_PATIENCE)), service));
        tokio::spawn(async move {
            let _ = connection.await; // a client that goes away is no error
            drop(place);
        });
    }
    let _ = timeout(GRACE, graceful.shutdown()).await;
}
