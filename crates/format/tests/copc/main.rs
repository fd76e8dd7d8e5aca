//! COPC files as octrees: golden files with values by another reader, files of others, and hostile bytes.

#![cfg(feature = "las")]

mod corpus;
mod golden;
mod hostile;
mod oracle;
mod util;
mod writer;
