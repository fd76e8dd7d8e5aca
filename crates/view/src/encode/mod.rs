//! The bytes of the protocol (`docs/view.md`, "Protocol"): all little-endian.

mod cells;
mod cloud;
mod header;
mod nodes;

pub(crate) use cloud::{Look, Unit, cost, encode_unit};
pub(crate) use header::{Flag, UNIT_HEADER_BYTES, UnitHeader};
pub(crate) use nodes::{BoxRow, boxes, nodes};
