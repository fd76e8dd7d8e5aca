//! Text for people; JSON is made in the commands.

mod accuracy;
pub(crate) mod conversion;
pub(crate) mod export;
pub(crate) mod measurement;
pub(crate) mod progress;
pub(crate) mod quantities;
pub(crate) mod text;
pub(crate) mod validation;
