//! Warnings that many scans share, as one.

use crate::ScanWarning;

/// Warnings at most; a file may have thousands of scans.
const MAX_WARNINGS: usize = 20;

/// The warnings about the scans of a file, each with the scans that share it.
#[derive(Debug, Default)]
pub(super) struct Notes(Vec<(ScanWarning, Vec<usize>)>);

impl Notes {
    /// Notes a warning about a scan.
    pub(super) fn add(&mut self, scan: usize, warning: ScanWarning) {
        if let Some((_, scans)) = self.0.iter_mut().find(|(noted, _)| *noted == warning) {
            scans.push(scan);
        } else if self.0.len() < 10 * MAX_WARNINGS {
            self.0.push((warning, vec![scan]));
        }
    }

    /// In the order in which the warnings were first added.
    pub(super) fn warnings(self) -> Vec<ScanWarning> {
        let is_cut = self.0.len() > MAX_WARNINGS;
        let kept = self.0.into_iter().take(MAX_WARNINGS);
        let in_scans = |(warning, scans)| ScanWarning::InScans { scans, warning: Box::new(warning) };
        kept.map(in_scans).chain(is_cut.then_some(ScanWarning::More)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_note_of_many_scans_is_one_line() {
        let note = |text: &str| ScanWarning::Other(text.to_owned());
        let mut notes = Notes::default();
        notes.add(2, note("b"));
        (0..9).for_each(|scan| notes.add(scan, note("a")));
        (0..1000).for_each(|i| notes.add(i, note(&format!("c{i}"))));
        let warnings = notes.warnings();
        assert_eq!(warnings.len(), MAX_WARNINGS + 1);
        assert_eq!(warnings[0].to_string(), "scan 3: b");
        assert_eq!(warnings[1].to_string(), "scans 1, 2, 3, 4, 5 and 4 more: a");
    }
}
