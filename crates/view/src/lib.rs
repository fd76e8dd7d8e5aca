//! A viewer of point clouds: datasets and a page that draws them, served to browsers of this machine.
//!
//! [`Dataset`] opens an octree, a binary tree or quantised batches, [`Server`] answers a browser. Nodes are decoded here, so that
//! the page has one small binary protocol for all formats (`docs/view.md`, "Protocol"). [`page()`] makes the page of one text,
//! for the server and to be put beside a dataset.
//!
//! ```no_run
//! use pointmill_view::{Dataset, Options, Server};
//!
//! # fn main() -> Result<(), pointmill_view::ViewError> {
//! let server = Server::bind(Options::default())?;
//! println!("{}", server.url());
//! server.run(vec![Dataset::open("city")?], || false)
//! # }
//! ```
//!
//! The server listens on the loopback interface alone, answers GET and HEAD, refuses names of other hosts (which is what keeps
//! pages of the web from reading through it), and gives no file that is not of a dataset. What a request may cost is known
//! before it is answered: points are decoded in as many threads as there are cores, and bodies share a limit of memory.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![deny(unsafe_code)]

mod dataset;
mod encode;
mod error;
mod http;
mod page;
mod refusal;
mod values;

pub use dataset::Dataset;
pub use error::ViewError;
pub use http::{Event, Events, Options, Server};
pub use page::{GENERATOR, PageSource, page};
