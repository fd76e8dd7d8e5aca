//! Rust source as words and signs: enough to see imports and paths.

/// An identifier, a number, `::`, or one other sign. Comments and literals are gone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) text: String,
    /// From 1.
    pub(crate) line: usize,
}

/// The tokens of `source` without items that are compiled for tests only.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    without_tests(&all_tokens(source))
}

fn all_tokens(source: &str) -> Vec<Token> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let (mut out, mut i, mut line) = (Vec::new(), 0, 1);
    while i < chars.len() {
        let start = i;
        match chars[i] {
            '/' if at(i + 1) == '/' => i = (i..chars.len()).find(|i| chars[*i] == '\n').unwrap_or(chars.len()),
            '/' if at(i + 1) == '*' => i = end_of_comment(&chars, i),
            '"' => i = end_of_string(&chars, i),
            '\'' if at(i + 1) == '\\' => i = after_quote(&chars, i + 3),
            '\'' if at(i + 2) == '\'' => i += 3,
            '\'' => i += 1 + (i + 1..chars.len()).take_while(|i| is_word(chars[*i])).count(), // a lifetime
            'r' | 'b' | 'c' if end_of_prefixed(&chars, i).is_some() => {
                i = end_of_prefixed(&chars, i).unwrap();
            }
            ':' if at(i + 1) == ':' => {
                out.push(Token { text: "::".to_owned(), line });
                i += 2;
            }
            c if is_word(c) => {
                i += (i..chars.len()).take_while(|i| is_word(chars[*i])).count();
                out.push(Token { text: chars[start..i].iter().collect(), line });
            }
            c => {
                i += 1;
                if !c.is_whitespace() {
                    out.push(Token { text: c.to_string(), line });
                }
            }
        }
        line += chars[start..i].iter().filter(|c| **c == '\n').count();
    }
    out
}

/// Comments nest.
fn end_of_comment(chars: &[char], start: usize) -> usize {
    let (mut depth, mut i) = (0, start);
    while i < chars.len() {
        match (chars[i], chars.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            break;
        }
    }
    i
}

fn end_of_string(chars: &[char], quote: usize) -> usize {
    let mut i = quote + 1;
    while i < chars.len() && chars[i] != '"' {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    (i + 1).min(chars.len())
}

/// Behind the next single quote.
fn after_quote(chars: &[char], from: usize) -> usize {
    (from..chars.len()).find(|i| chars[*i] == '\'').map_or(chars.len(), |i| i + 1)
}

/// The end of `b"…"`, `r#"…"#`, `b'…'` and their like at `start`; `None` for a word that begins with such a letter.
fn end_of_prefixed(chars: &[char], start: usize) -> Option<usize> {
    let prefix: String = chars[start..].iter().take_while(|c| "rbc".contains(**c)).collect();
    let after = start + prefix.len();
    if start > 0 && (chars[start - 1].is_alphanumeric() || chars[start - 1] == '_') {
        return None;
    }
    let hashes = chars[after..].iter().take_while(|c| **c == '#').count();
    let quote = chars.get(after + hashes).copied();
    match (prefix.as_str(), quote) {
        ("r" | "br" | "cr", Some('"')) => {
            let body = after + hashes + 1;
            let closes = |i: &usize| {
                chars[*i] == '"' && chars[*i + 1..].iter().take(hashes).filter(|c| **c == '#').count() == hashes
            };
            Some((body..chars.len()).find(closes).map_or(chars.len(), |i| i + 1 + hashes))
        }
        ("b" | "c", Some('"')) if hashes == 0 => Some(end_of_string(chars, after)),
        ("b", Some('\'')) if hashes == 0 => {
            let body = if chars.get(after + 1) == Some(&'\\') { after + 3 } else { after + 2 };
            Some(after_quote(chars, body))
        }
        _ => None,
    }
}

fn without_tests(all: &[Token]) -> Vec<Token> {
    let mut out = Vec::new();
    let mut i = 0;
    while i < all.len() {
        if is_test_attribute(&all[i..]) {
            while text(all, i) == "#" {
                i = end_of_group(all, i + 1);
            }
            i = end_of_item(all, i);
        } else {
            out.push(all[i].clone());
            i += 1;
        }
    }
    out
}

fn is_test_attribute(tokens: &[Token]) -> bool {
    let begins = |with: &[&str]| with.iter().enumerate().all(|(i, word)| text(tokens, i) == *word);
    begins(&["#", "[", "cfg", "(", "test", ")"]) || begins(&["#", "[", "cfg", "(", "all", "(", "test", ","])
}

/// Behind the group that opens at `open`.
fn end_of_group(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (i, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i + 1;
        }
    }
    tokens.len()
}

/// Behind the item that begins at `start`: its `;` or its block.
fn end_of_item(tokens: &[Token], start: usize) -> usize {
    let mut i = start;
    while i < tokens.len() {
        match text(tokens, i) {
            ";" => return i + 1,
            "{" => {
                let end = end_of_group(tokens, i);
                return if text(tokens, end) == ";" { end + 1 } else { end }; // `use a::{b};`
            }
            "(" | "[" => i = end_of_group(tokens, i),
            _ => i += 1,
        }
    }
    i
}

/// The text of token `i`; empty behind the end.
pub(crate) fn text(tokens: &[Token], i: usize) -> &str {
    tokens.get(i).map_or("", |token| token.text.as_str())
}

#[test]
fn comments_literals_and_tests_are_no_tokens() {
    let source = r##"
        use a::b; // use c::d;
        /* use /* e */ f; */ const S: &str = "use g \" ;"; const R: &str = r#"use "h";"#;
        const C: [char; 2] = ['"', '\'']; fn f<'a>(x: &'a u8) -> [u8; 2] { b"use i;"; b'"'; }
        #[cfg(test)] #[path = "x"] mod tests { use j::k; }
        #[cfg(test)] use l::{m, n};
        #[cfg(feature = "las")] use o::p;
    "##;
    let words: Vec<String> = tokens(source).into_iter().map(|t| t.text).filter(|t| t.len() == 1).collect();
    let letters = words.iter().filter(|w| w.chars().all(char::is_lowercase)).cloned().collect::<String>();
    assert_eq!(letters, "abfxop");
    assert_eq!(tokens(source).last().unwrap().line, 7);
}
