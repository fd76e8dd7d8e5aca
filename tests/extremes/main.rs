//! Coordinates at the extremes, through every output: what a decoder that follows `docs/formats` gets is compared, point by
//! point and without rounding, with what the scan has, and held against the bounds that `docs/design/numerics.md` derives.
//!
//! A case is a row of [`cases`], an output one of [`output::OUTPUTS`]. The long part:
//! `cargo test --test extremes -- --ignored`.

mod attained;
mod bounds;
mod case;
mod cases;
mod colours;
mod exact;
mod input;
mod long;
mod output;
mod random;
mod refused;
#[allow(dead_code)] // shared with the tests of the command line
#[path = "../cli/support.rs"]
mod support;
