//! JSON descriptions: fields that are taken out with a fault that names them, text that reads back as it was, and what
//! programs that take JSON for JavaScript leave in it.

mod fields;
mod relaxed;
mod text;

pub(crate) use fields::{Fault, Fields, broken, syntax_error, unsupported};
pub(crate) use relaxed::without_javascript;
pub(crate) use text::{number, numbers, string, write_field};
