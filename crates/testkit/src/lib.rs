//! What the tests of all crates share. Not published; nothing but tests depends on it.
//!
//! * [`random`]: one generator, the same numbers everywhere.
//! * [`files`]: paths of fixtures and of the corpus of real files, temporary files, files of a dataset.
//! * [`scans`]: the scans among the fixtures, with kind and right point count.
//! * [`golden`]: the tables of what other programs read from the fixtures (`fixtures/*/expected.tsv`).
//! * [`damage`]: cut files, flipped bits, wrong fields.
//! * [`las`]: LAS files of any points, any field of which may be wrong.
//! * [`las_records`]: variable length records and extra bytes for these.
//! * [`reader`]: what every reader of scans promises, checked on any [`pointmill_format::Scan`].
//!
//! Everything here panics where a test must fail, and says what was found.
//!
//! The crate depends on `pointmill-format` without features, and the integration tests of that crate depend on this
//! one. Unit tests inside `pointmill-format` may use [`random`] alone: the types of the library under test are not
//! those that this crate knows.

pub mod damage;
pub mod files;
pub mod golden;
pub mod las;
pub mod las_records;
pub mod random;
pub mod reader;
pub mod scans;

pub use random::Random;
