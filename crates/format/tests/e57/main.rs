//! E57 as its users meet it: files of libE57Format and others read right, damaged ones reported and survived.
#![cfg(feature = "e57")]

mod common;
mod corpus;
mod damage;
mod deviations;
mod golden;
mod images;
mod mutation;
mod oracle;
mod values;
