//! A decoder of LAZ chunks, for bytes that nobody vouches for: no input makes it panic, recurse, or work longer than
//! its size justifies.
//!
//! `coder` decodes symbols, `model` learns how likely they are, `integer` and `median` predict numbers; the items of
//! formats 0–5 (`point10`, `gps_time`, `colour`, `wave_packet`, `version_1`) follow one another in `pointwise`, the
//! layers of formats 6–10 (`base`, `layers`, `item_layers`) stand side by side in `layered`. Models are made once a thread and reset
//! for each chunk.
//!
//! A thread decodes two chunks in turn where it can (`lanes`, `layered_chunk`): each symbol waits for the one before, and
//! meanwhile the processor has the other chunk to do. What decoders do for a symbol has therefore no branch that depends on
//! it, and is written out for both chunks (`in_turn`).
//!
//! Source: M. Isenburg, "LASzip: lossless compression of LiDAR data" (2013), and the files that LASzip 3.5 writes.

// arrays of unique references, used by number: clippy takes that for reading them
#![allow(clippy::needless_pass_by_value, clippy::needless_range_loop)]

mod base;
mod channels;
mod coder;
mod colour;
mod family;
mod gps_time;
mod in_turn;
mod input;
mod integer;
mod item_layers;
mod items;
mod lanes;
mod layered;
mod layered_chunk;
mod layers;
mod median;
mod model;
mod point10;
mod pointwise;
mod returns;
mod stop;
mod table;
#[cfg(test)]
mod tests;
mod version_1;
mod wave_packet;

pub(super) use input::{Input, WINDOW};
pub(super) use items::{Item, ItemKind, record_len};
pub(super) use lanes::PointwiseModels;
pub(super) use layered::{LayeredModels, Part, Parts};
pub(super) use layered_chunk::{Layered, LayeredPair};
pub(super) use pointwise::{Filled, Pair, Pointwise};
pub(super) use stop::Stop;
pub(super) use table::decode_entries;
