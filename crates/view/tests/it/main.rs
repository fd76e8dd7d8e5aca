//! The server as a browser sees it: every answer is taken apart and compared with what the format crate reads.

mod abuse;
mod batches;
mod broken;
mod client;
mod decode;
mod files;
mod octrees;
mod trees;
