//! From points to pixels.

mod splat;
mod target;

pub(crate) use splat::{Pass, Sizes, Splats};
pub(crate) use target::{Target, word};
