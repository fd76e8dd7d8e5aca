//! Names come from files.

/// Longest label, characters.
const MAX_LABEL: usize = 160;

/// No control characters to the terminal, and no pages of text.
pub(super) fn printable(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(MAX_LABEL).collect()
}
