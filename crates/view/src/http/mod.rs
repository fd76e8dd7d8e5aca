//! The server: connections, addresses, and the answers to requests.

mod answer;
mod files;
mod guard;
mod patience;
mod query;
mod routes;
mod server;
mod state;

pub use server::Server;
pub use state::{Event, Events, Options};
