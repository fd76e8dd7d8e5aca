//! What readers of scans hold in memory: batches of bounded size, and no more than they say.
#![cfg(all(feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]

mod batches;
mod counting;
mod datasets;
mod decode;
mod hostile;
mod scenes;

#[global_allocator]
static MEMORY: counting::Counting = counting::Counting;
