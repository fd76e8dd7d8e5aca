//! PLY, PCD and text as their users meet them: files of other encoders read right, damaged ones reported and survived.
#![cfg(all(feature = "pcd", feature = "ply", feature = "text"))]

mod common;
mod corpus;
mod damage;
mod golden;
mod hand_made;
mod pcd;
mod ply;
mod text_kinds;
