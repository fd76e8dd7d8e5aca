//! The program as a user meets it: commands, exit codes, what is written and, above all, what is left alone.

mod accuracy;
mod arguments;
mod attributes;
mod bad_input;
mod bad_output;
mod batches;
mod copc;
mod cut_short;
mod extract;
mod folders;
mod formats;
mod hostile;
mod inputs;
mod interrupted;
mod many;
mod memory;
mod mistakes;
mod mounted;
mod odd_places;
mod overwriting;
mod placing;
mod potree1;
mod precision;
mod reporting;

mod same_points;
mod sameness;
mod scans_within;
mod several;
mod stops;
mod support;
mod text_inputs;
mod units;
mod validating;
mod viewers;
