//! Text that may quote a file, as it may reach a terminal.

use std::borrow::Cow;
use std::fmt::Write as _;

/// True for what a terminal obeys (control characters), and for what changes or hides how the text beside it is shown
/// (direction marks and overrides, separators of lines, marks without a width, tags). The joiners of scripts are text.
fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}')
        || matches!(c, '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// Text on one line that may quote a file (its name, a CRS, an attribute): blanks stand for breaks of lines and tabs,
/// U+FFFD for what else must not reach a terminal.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    replaced(text, |c| if c.is_whitespace() { ' ' } else { '\u{fffd}' })
}

/// [`printable`] for lines: their breaks stay.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    replaced(text, |c| if c == '\n' { c } else { '\u{fffd}' })
}

fn replaced(text: &str, with: impl Fn(char) -> char) -> Cow<'_, str> {
    if !text.contains(is_unprintable) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.chars().map(|c| if is_unprintable(c) { with(c) } else { c }).collect())
}

/// JSON of the same content that holds nothing a terminal obeys: what a serialiser leaves as it is becomes an escape,
/// as only strings can hold it. Breaks between lines stay.
pub(crate) fn json_escaped(json: &str) -> Cow<'_, str> {
    let is_open = |c: char| c != '\n' && is_unprintable(c);
    if !json.contains(is_open) {
        return Cow::Borrowed(json);
    }
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if is_open(c) {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| {
                let _ = write!(out, "\\u{unit:04x}");
            });
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_a_terminal_obeys_is_printed() {
        let nasty = "a\u{1b}[31m\r\nb\tc\u{7f}\u{9b}d\u{202e}e\u{2066}f\u{200b}g\u{2028}h\u{e0041}";
        let r = '\u{fffd}';
        assert_eq!(printable(nasty), format!("a{r}[31m  b c{r}{r}d{r}e{r}f{r}g h{r}"));
        assert_eq!(printable_lines("a\u{1b}\nb\r\n"), format!("a{r}\nb{r}\n"));
        for text in ["Gelände/日本 'q\" scan.las", "خ\u{200c}و", "👩\u{200d}🚀"] {
            assert!(matches!(printable(text), Cow::Borrowed(same) if same == text));
        }
    }

    #[test]
    fn json_says_the_same_in_escapes() {
        let value = serde_json::json!({ "path": "a\u{1b}\u{7f}\u{9b}\u{202e}\u{e0041}\nö" });
        let text = format!("{value:#}");
        let escaped = json_escaped(&text);
        assert!(!escaped.contains(|c| c != '\n' && is_unprintable(c)), "{escaped}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped).unwrap(), value);
    }
}
