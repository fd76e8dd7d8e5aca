//! Text of JSON values: doubles that come back bit for bit.

use std::fmt::Write;

use serde_json::Value;

/// Appends a comma and the field `name`, on a line of its own.
pub(crate) fn write_field(json: &mut String, indent: &str, name: &str, value: &dyn std::fmt::Display) {
    // Writing to a string cannot fail.
    let _ = write!(json, ",\n{indent}{}: {value}", string(name));
}

/// A string as JSON.
pub(crate) fn string(text: &str) -> String {
    Value::from(text).to_string()
}

/// An array of numbers on one line.
pub(crate) fn numbers(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "))
}

/// The shortest text that reads back as the same double; whole numbers without a fraction, as the reference writes
/// them. What JSON cannot say becomes the nearest thing that it can.
pub(crate) fn number(value: f64) -> String {
    let value = if value.is_nan() { 0.0 } else { value.clamp(f64::MIN, f64::MAX) };
    let negative_zero = value == 0.0 && value.is_sign_negative();
    // 2^53: up to here every whole number is its own double.
    if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 && !negative_zero {
        (value as i64).to_string()
    } else {
        Value::from(value).to_string()
    }
}
