//! Datasets as scans: the golden datasets give their points, levels are chosen, and what lies is refused.

mod damage;
mod golden;
mod hostile;
mod leaves;
mod levels;
mod util;
