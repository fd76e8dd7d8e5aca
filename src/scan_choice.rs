//! `--scan`: whether the inputs have the scans that were chosen.

use std::path::PathBuf;

use pointmill_format::scan::text::TextKind;
use pointmill_format::{OpenOptions, ScanKind, open_scan, scans_named};

use crate::exit::Failure;

/// Scans that are named in a line.
const MAX_NAMED: usize = 20;

/// Checks that each chosen scan is in one of the files; without a choice nothing is opened.
pub(crate) fn check(files: &[PathBuf], options: &OpenOptions) -> Result<(), Failure> {
    let Some(choices) = &options.scans else { return Ok(()) };
    let mut missing: Vec<&String> = choices.iter().collect();
    let (mut known, mut unreadable) = (Vec::new(), None);
    let mut everything = options.clone();
    everything.scans = None;
    for file in files {
        if !matches!(ScanKind::of_file(file), Ok(Some(ScanKind::E57 | ScanKind::Text(TextKind::Ptx) | ScanKind::Depth)))
        {
            continue;
        }
        match open_scan(file, &everything) {
            Ok(scan) => {
                let names: Vec<&str> = scan.info().parts.iter().map(|part| part.name.as_str()).collect();
                missing.retain(|choice| scans_named(&names, choice).is_empty());
                known.extend(names.iter().enumerate().map(|(i, name)| described(i + 1, name)));
            }
            Err(error) => {
                unreadable.get_or_insert(error);
            }
        }
    }
    match (missing.first(), unreadable) {
        (None, _) => Ok(()),
        // it may be in the file that cannot be opened
        (Some(_), Some(error)) => Err(error.into()),
        (Some(choice), None) => Err(Failure::Usage(format!("--scan {choice}: {}", there_are(&known)))),
    }
}

/// "2 (Hall)".
fn described(number: usize, name: &str) -> String {
    if name.is_empty() { number.to_string() } else { format!("{number} ({name})") }
}

fn there_are(known: &[String]) -> String {
    match known.len() {
        0 => "no input has scans within it; E57 and PTX files do, and folders of depth maps".to_owned(),
        n if n > MAX_NAMED => {
            let named = known[..MAX_NAMED].join(", ");
            format!("no input has a scan of that name or number; there are {named} and {} more", n - MAX_NAMED)
        }
        _ => format!("no input has a scan of that name or number; there are {}", known.join(", ")),
    }
}
