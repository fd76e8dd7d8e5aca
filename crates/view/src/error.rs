//! Why nothing is served.

use std::io;

use pointmill_format::{ReadError, system_reason};

/// What keeps a server from starting; prints as one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A dataset that cannot be opened.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The port is taken, or may not be used.
    #[error("127.0.0.1:{port}: {}", listen_reason(error))]
    Listen {
        /// The port that was requested; 0 is any.
        port: u16,
        /// What the system says.
        error: io::Error,
    },
    /// The system gives no threads, or the page's files cannot be read.
    #[error("{what}: {}", system_reason(error))]
    System {
        /// What was attempted.
        what: String,
        /// What the system says.
        error: io::Error,
    },
}

fn listen_reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::AddrInUse => "the port is in use".to_owned(),
        io::ErrorKind::PermissionDenied => "ports below 1024 need more rights".to_owned(),
        _ => system_reason(error),
    }
}
