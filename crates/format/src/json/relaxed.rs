//! What is JavaScript and no JSON, blanked out in place: bytes keep their places, so that faults are told where they are.

use std::borrow::Cow;

/// `bytes` with blanks in place of a byte order mark, comments, commas that nothing follows, what stands before the first
/// brace (`var cloud =`) and the semicolon behind the last. What is in strings stays. One pass, whatever the bytes are.
pub(crate) fn without_javascript(bytes: &[u8]) -> Cow<'_, [u8]> {
    let mut text = Cow::Borrowed(bytes);
    if bytes.starts_with(b"\xef\xbb\xbf") {
        blank(&mut text, 0..3);
    }
    without_comments(&mut text);
    without_assignment(&mut text);
    without_idle_commas(&mut text);
    text
}

fn blank(text: &mut Cow<'_, [u8]>, range: std::ops::Range<usize>) {
    // lines stay lines: the parser counts them
    for byte in text.to_mut()[range].iter_mut().filter(|b| **b != b'\n') {
        *byte = b' ';
    }
}

/// The place after the string that begins at `start`, or the end.
fn after_string(text: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while let Some(byte) = text.get(at) {
        match byte {
            b'"' => return at + 1,
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
    text.len()
}

fn without_comments(text: &mut Cow<'_, [u8]>) {
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let len = match rest {
            [b'"', ..] => {
                at = after_string(text, at);
                continue;
            }
            [b'/', b'/', ..] => rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len()),
            // one that does not end is left for the parser to refuse
            [b'/', b'*', body @ ..] => body.windows(2).position(|w| w == b"*/").map_or(0, |end| end + 4),
            _ => 0,
        };
        if len == 0 {
            if rest.starts_with(b"/*") {
                return;
            }
            at += 1;
            continue;
        }
        blank(text, at..at + len);
        at += len;
    }
}

/// `var cloud = {…};`, `module.exports = {…}`.
fn without_assignment(text: &mut Cow<'_, [u8]>) {
    let Some(brace) = text.iter().position(|b| *b == b'{') else { return };
    let before = text[..brace].trim_ascii();
    let is_name = |b: &u8| b.is_ascii_alphanumeric() || b"_$. \t\r\n".contains(b);
    if let [name @ .., b'='] = before
        && name.iter().all(is_name)
    {
        blank(text, 0..brace);
    }
    let end = text.trim_ascii_end().len();
    if text[..end].ends_with(b";") && text[..end - 1].trim_ascii_end().ends_with(b"}") {
        blank(text, end - 1..end);
    }
}

/// Commas before a bracket that closes.
fn without_idle_commas(text: &mut Cow<'_, [u8]>) {
    let (mut at, mut comma) = (0, None);
    while let Some(byte) = text.get(at) {
        match byte {
            b'"' => {
                at = after_string(text, at);
                comma = None;
                continue;
            }
            b',' => comma = Some(at),
            b'}' | b']' => {
                if let Some(comma) = comma.take() {
                    blank(text, comma..comma + 1);
                }
            }
            byte if byte.is_ascii_whitespace() => {}
            _ => comma = None,
        }
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn javascript_becomes_blanks_and_strings_stay() {
        for (javascript, json) in [
            ("{\"a\": 1}", "{\"a\": 1}"),
            ("\u{feff}{\"a\": 1}", "   {\"a\": 1}"),
            ("{\"a\": [1, 2,], // two\n}", "{\"a\": [1, 2 ]        \n}"),
            ("/* a\nb */{\"u\": \"http://x/*y*/,}\",}", "    \n    {\"u\": \"http://x/*y*/,}\" }"),
            ("var cloud = {\"a\\\"//\": 1 , };\n", "            {\"a\\\"//\": 1   } \n"),
            ("module.exports={} ; ", "               {}   "),
            ("{\"a\": 1", "{\"a\": 1"),
            ("{\"a\\", "{\"a\\"),
            ("/* no end {}", "/* no end {}"),
            ("alert(1); x = {}", "alert(1); x = {}"),
            ("[1,,]", "[1, ]"),
        ] {
            let text = without_javascript(javascript.as_bytes());
            assert_eq!(String::from_utf8_lossy(&text), json, "{javascript}");
        }
        assert!(matches!(without_javascript(b"{\"a\": [1, 2]}\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn many_openings_of_comments_take_no_longer_than_their_bytes() {
        let hostile = "/*".repeat(1 << 20);
        assert_eq!(without_javascript(hostile.as_bytes()).len(), 2 << 20);
    }
}
