//! Datasets as scans: the golden datasets give their points, levels are chosen, and what lies is refused.

#![cfg(all(feature = "las", feature = "zip"))]

mod damage;
mod golden;
mod hostile;
mod leaves;
mod levels;
mod util;
