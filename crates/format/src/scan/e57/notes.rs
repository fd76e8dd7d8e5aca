//! Warnings that many scans share, as one line.

/// At most so many lines; a file may have thousands of scans.
const MAX_LINES: usize = 20;
/// At most so many scans are named in a line.
const MAX_NAMED: usize = 5;

/// What is to be told of the scans of a file.
#[derive(Debug, Default)]
pub(super) struct Notes(Vec<(String, Vec<usize>)>);

impl Notes {
    /// Notes `what` of a scan.
    pub(super) fn add(&mut self, scan: usize, what: impl Into<String>) {
        let what = what.into();
        if let Some((_, scans)) = self.0.iter_mut().find(|(text, _)| *text == what) {
            scans.push(scan);
        } else if self.0.len() < 10 * MAX_LINES {
            self.0.push((what, vec![scan]));
        }
    }

    /// The lines: "scans 0, 3: …", in the order in which the notes were first added.
    pub(super) fn lines(&self) -> Vec<String> {
        let mut lines: Vec<_> = self.0.iter().take(MAX_LINES).map(|(what, scans)| line(what, scans)).collect();
        if self.0.len() > MAX_LINES {
            lines.push("there is more of this kind".to_owned());
        }
        lines
    }
}

fn line(what: &str, scans: &[usize]) -> String {
    let named: Vec<_> = scans.iter().take(MAX_NAMED).map(usize::to_string).collect();
    let more = match scans.len() - named.len() {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!("scan{} {}{more}: {what}", if scans.len() == 1 { "" } else { "s" }, named.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_note_of_many_scans_is_one_line() {
        let mut notes = Notes::default();
        notes.add(2, "b");
        (0..9).for_each(|scan| notes.add(scan, "a"));
        assert_eq!(notes.lines(), ["scan 2: b", "scans 0, 1, 2, 3, 4 and 4 more: a"]);
        (0..1000).for_each(|i| notes.add(i, format!("c{i}")));
        assert_eq!(notes.lines().len(), MAX_LINES + 1);
    }
}
