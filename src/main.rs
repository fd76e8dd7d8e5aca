//! The command line of pointmill.
fn main() {}
