//! LAS and LAZ as their users meet them: files of other encoders read right, damaged ones reported and survived.
#![cfg(feature = "las")]

mod common;
mod corpus;
mod damage;
mod golden;
mod hostile;
mod laz_chunks;
mod mended;
mod mutation;
mod oracle;
mod records;
#[cfg(feature = "laz")]
mod write;
#[cfg(feature = "laz")]
mod write_values;
