//! Does a dataset keep the promises of its format?
