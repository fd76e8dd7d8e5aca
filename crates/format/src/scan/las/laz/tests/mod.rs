//! The decoder against the encoder of the crate `laz`, and against bytes that no encoder wrote.

mod damage;
mod differential;
mod format;
mod pairs;
mod round_trip;
mod version_1;
