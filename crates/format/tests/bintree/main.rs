//! Mean-split binary trees: what is written is what the page says, and reads back; queries find what a search of all
//! points finds; bytes that lie are refused.

mod build;
mod exercise;
mod golden;
mod hostile;
#[cfg(feature = "rstar")]
mod nearest;
mod queries;
mod round_trip;
mod util;
