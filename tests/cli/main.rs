//! The program as a user meets it: commands, exit codes, what is written and, above all, what is left alone.

mod arguments;
mod bad_input;
mod bad_output;
mod batches;
mod cut_short;
mod formats;
mod hostile;
mod inputs;
mod interrupted;
mod placing;
mod precision;
mod reporting;
mod same_points;
mod sameness;
mod several;
mod support;
