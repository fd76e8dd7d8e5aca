//! The commands, a file or folder for each.

pub(crate) mod convert;
pub(crate) mod export;
pub(crate) mod extract;
pub(crate) mod info;
pub(crate) mod job;
pub(crate) mod manual;
pub(crate) mod measure;
mod page_file;
pub(crate) mod preview;
mod report_file;
pub(crate) mod validate;
mod verify;
pub(crate) mod view;
mod whole_file;
