//! Potree 2.0 as a renderer or a converter meets it: datasets of others are read whole, what is written is read back,
//! and hostile bytes end in an error.

mod corpus;
mod golden;
mod hostile;
mod round_trip;
mod util;
