//! Potree 1.x as a renderer or a converter meets it: datasets of others are read whole, wrong counts and all, what is
//! written is read back, and hostile bytes end in an error.

mod corpus;
mod golden;
mod hostile;
#[cfg(feature = "las")]
mod las_nodes;
mod util;
mod walk;
