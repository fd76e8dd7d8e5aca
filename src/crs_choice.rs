//! `--crs` and `--reproject`: whether the numbers of EPSG that were typed are any.

use pointmill_converter::{CrsNote, resolve_crs};
use pointmill_crs::Placing;
use pointmill_format::Crs;

use crate::exit::Failure;

/// Refuses `EPSG:n` and `EPSG:n+m` with a number that is in no table: one slip of a digit, and all viewers put the
/// dataset elsewhere. What else the text may be, its readers judge.
pub(crate) fn check(option: &str, text: &str) -> Result<(), Failure> {
    let text = text.trim();
    let text = text.strip_prefix("+init=").unwrap_or(text);
    if !Placing::is_unknown_code(text) {
        return Ok(());
    }
    let Some((code, height)) = codes(text) else { return Ok(()) };
    let unknown = match height {
        _ if !has_definition(code) => Some(code),
        Some(height) if !is_height(height) => Some(height),
        _ => None,
    };
    match unknown {
        None => Ok(()),
        Some(code) => Err(Failure::Usage(format!(
            "{option}: EPSG:{code} is not known; correct the number, or give the definition itself (+proj=… or WKT)"
        ))),
    }
}

fn codes(text: &str) -> Option<(u32, Option<u32>)> {
    let codes = text.get(5..)?;
    match codes.split_once('+') {
        Some((code, height)) => Some((code.trim().parse().ok()?, Some(height.trim().parse().ok()?))),
        None => Some((codes.trim().parse().ok()?, None)),
    }
}

/// True if the table of definitions has the code; that of projections may lack it.
fn has_definition(code: u32) -> bool {
    let notes = resolve_crs(&Crs::new(None, Some(code), None)).notes;
    !notes.iter().any(|note| matches!(note, CrsNote::NotInTable { .. }))
}

/// True if the code is of a system of heights whose unit is known.
fn is_height(code: u32) -> bool {
    resolve_crs(&Crs::new(None, Some(4326), Some(code))).vertical_unit.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_either_table_are_known_and_others_refused() {
        for text in
            ["EPSG:25832", "epsg:2994", "EPSG:25832+5783", "EPSG:4979", " EPSG:3857 ", "+proj=x", "EPSG:x", "WKT"]
        {
            assert!(check("--crs", text).is_ok(), "{text}");
        }
        for (text, code) in [
            ("EPSG:999999", 999_999),
            ("EPSG:0", 0),
            ("EPSG:25832+99999", 99_999),
            ("epsg:1", 1),
            ("+init=epsg:999999", 999_999),
        ] {
            let Err(Failure::Usage(line)) = check("--crs", text) else { panic!("{text}") };
            assert!(line.starts_with(&format!("--crs: EPSG:{code} is not known")), "{line}");
        }
    }
}
