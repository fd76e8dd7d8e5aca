//! Depth maps as their users meet them: points where an independent script puts them, damage reported and survived.
#![cfg(feature = "depth")]

mod common;
mod damage;
mod golden;
mod pictures;
mod sequences;
