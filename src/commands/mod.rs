//! The commands, a file or folder for each.

pub(crate) mod convert;
pub(crate) mod extract;
pub(crate) mod info;
pub(crate) mod validate;
