//! A pull parser for the XML of E57 files: tags, attributes, text. Names are compared as they are written; namespaces
//! mean nothing here.
//!
//! It is strict where a fault could change what is read (tags that do not match, text that ends early) and lenient where
//! it cannot: an unknown entity stays as it is, an attribute that is there twice counts once.

use std::borrow::Cow;

/// Elements within each other: E57 needs about eight.
const MAX_DEPTH: usize = 200;

/// What comes next in the text.
#[derive(Debug)]
pub(super) enum Event<'a> {
    /// The start of an element; an [`Self::End`] follows, whether its tag is empty or not.
    Start(Tag<'a>),
    /// The end of the element that was last started and not ended.
    End,
    /// Text of that element, perhaps not all of it.
    Text(Cow<'a, str>),
}

/// The start tag of an element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tag<'a> {
    /// As it is written, with its prefix.
    pub(super) name: &'a str,
    /// All between the name and the end of the tag; well-formed.
    attributes: &'a str,
}

impl<'a> Tag<'a> {
    /// Names and values, in order.
    pub(super) fn attributes(&self) -> impl Iterator<Item = (&'a str, Cow<'a, str>)> + use<'a> {
        let mut rest = self.attributes;
        std::iter::from_fn(move || {
            let (name, value, after) = attribute(rest)?;
            rest = after;
            Some((name, unescaped(value)))
        })
    }
}

/// The first attribute of `text`: name, value, what follows.
fn attribute(text: &str) -> Option<(&str, &str, &str)> {
    let (name, rest) = text.trim_start().split_once('=')?;
    let rest = rest.trim_start();
    let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let (value, rest) = rest[1..].split_once(quote)?;
    let name = name.trim_end();
    (is_name(name) && !value.contains('<')).then_some((name, value, rest))
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && !name.contains(|c: char| c.is_whitespace() || "<>&\"'=/".contains(c))
}

/// Reads a text from front to back.
#[derive(Debug)]
pub(super) struct Markup<'a> {
    text: &'a str,
    at: usize,
    /// Names of the open elements.
    open: Vec<&'a str>,
    /// The last tag was an empty one; its end is still to be told.
    ends: bool,
    has_root: bool,
}

impl<'a> Markup<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, at: 0, open: Vec::new(), ends: false, has_root: false }
    }

    /// What comes next; `None` behind the end of the root element.
    ///
    /// # Errors
    /// What is not well-formed, and where.
    pub(super) fn next(&mut self) -> Result<Option<Event<'a>>, String> {
        loop {
            if std::mem::take(&mut self.ends) {
                self.open.pop();
                return Ok(Some(Event::End));
            }
            if self.has_root && self.open.is_empty() {
                return Ok(None);
            }
            let rest = &self.text[self.at..];
            if rest.is_empty() {
                return Err(match self.open.last() {
                    Some(name) => format!("it ends within <{name}>"),
                    None => "it has no element".to_owned(),
                });
            }
            if let Some(event) = self.step(rest)? {
                return Ok(Some(event));
            }
        }
    }

    /// Takes one piece of markup, or the text before it.
    fn step(&mut self, rest: &'a str) -> Result<Option<Event<'a>>, String> {
        if !rest.starts_with('<') {
            let len = rest.find('<').unwrap_or(rest.len());
            self.at += len;
            let text = &rest[..len];
            let is_between = text.trim_matches(|c: char| c.is_whitespace() || c == '\u{feff}').is_empty();
            return match self.open.is_empty() {
                true if is_between => Ok(None),
                true => Err(format!("text outside of all elements at its byte {}", self.at - len)),
                false => Ok(Some(Event::Text(unescaped(text)))),
            };
        }
        if let Some(data) = rest.strip_prefix("<![CDATA[") {
            let len = data.find("]]>").ok_or("it ends within CDATA")?;
            self.at += "<![CDATA[".len() + len + "]]>".len();
            return Ok((!self.open.is_empty()).then_some(Event::Text(Cow::Borrowed(&data[..len]))));
        }
        for (start, end) in [("<!--", "-->"), ("<?", "?>")] {
            if let Some(inside) = rest.strip_prefix(start) {
                let len = inside.find(end).ok_or_else(|| format!("it ends within {start}"))?;
                self.at += start.len() + len + end.len();
                return Ok(None);
            }
        }
        if rest.starts_with("<!") {
            return Err(format!("a document type at its byte {}", self.at));
        }
        if let Some(name) = rest.strip_prefix("</") {
            return self.end(name).map(Some);
        }
        self.start(&rest[1..]).map(Some)
    }

    fn end(&mut self, rest: &'a str) -> Result<Event<'a>, String> {
        let at = self.at;
        let len = rest.find('>').ok_or("it ends within a tag")?;
        self.at += "</".len() + len + 1;
        let name = rest[..len].trim_end();
        match self.open.pop() {
            Some(open) if open == name => Ok(Event::End),
            Some(open) => Err(format!("</{}> closes <{open}> at its byte {at}", short(name))),
            None => Err(format!("</{}> closes nothing at its byte {at}", short(name))),
        }
    }

    fn start(&mut self, rest: &'a str) -> Result<Event<'a>, String> {
        let at = self.at;
        let faulty = || format!("a tag that is none at its byte {at}");
        let len = rest.find(|c: char| c.is_whitespace() || c == '/' || c == '>').ok_or("it ends within a tag")?;
        let name = &rest[..len];
        if !is_name(name) {
            return Err(faulty());
        }
        let all = &rest[len..];
        let mut left = all.trim_start();
        while !left.starts_with(['>', '/']) {
            (_, _, left) = attribute(left).ok_or_else(faulty)?;
            left = left.trim_start();
        }
        let attributes = &all[..all.len() - left.len()];
        let close = if left.starts_with("/>") { "/>" } else { ">" };
        let after = left.strip_prefix(close).ok_or_else(faulty)?;
        self.at = self.text.len() - after.len();
        self.open.push(name);
        if self.open.len() > MAX_DEPTH {
            return Err(format!("more than {MAX_DEPTH} elements within each other"));
        }
        (self.ends, self.has_root) = (close == "/>", true);
        Ok(Event::Start(Tag { name, attributes }))
    }
}

/// The start of a name, for a message.
fn short(name: &str) -> &str {
    name.char_indices().nth(40).map_or(name, |(end, _)| &name[..end])
}

/// Text with its entities replaced; unknown ones stay.
fn unescaped(text: &str) -> Cow<'_, str> {
    if !text.contains('&') {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        // the longest entity of a character is &#1114111;
        let end = rest.bytes().take(12).position(|b| b == b';');
        match end.and_then(|end| Some((entity(&rest[1..end])?, end))) {
            Some((c, end)) => {
                out.push(c);
                rest = &rest[end + 1..];
            }
            None => {
                out.push('&');
                rest = &rest[1..];
            }
        }
    }
    out.push_str(rest);
    Cow::Owned(out)
}

fn entity(name: &str) -> Option<char> {
    match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let number = name.strip_prefix('#')?;
            let code = match number.strip_prefix(['x', 'X']) {
                Some(hex) => u32::from_str_radix(hex, 16),
                None => number.parse(),
            };
            code.ok().and_then(char::from_u32)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All that the parser tells, as text: `<name a=b>`, `>` for an end, text as it is.
    fn told(text: &str) -> Result<String, String> {
        let (mut markup, mut out) = (Markup::new(text), String::new());
        while let Some(event) = markup.next()? {
            match event {
                Event::Start(tag) => {
                    let attributes: String = tag.attributes().map(|(n, v)| format!(" {n}={v}")).collect();
                    out += &format!("<{}{attributes}|", tag.name);
                }
                Event::End => out.push('>'),
                Event::Text(text) => out += &text,
            }
        }
        Ok(out)
    }

    #[test]
    fn elements_attributes_and_text_come_in_order() {
        let text = "\u{feff}<?xml version=\"1.0\"?>\n<!-- <b> --><a x = '1 > \"2\"' y=\"&lt;&#xE4;&#66;\">t&amp;u<b/>\
                    <![CDATA[<&amp;]]>R&D &nix; &<c >v</c ></a> rest";
        assert_eq!(told(text).unwrap(), "<a x=1 > \"2\" y=<äB|t&u<b|><&amp;R&D &nix; &<c|v>>");
    }

    #[test]
    fn what_is_not_well_formed_is_told_with_its_place() {
        let table = [
            ("", "no element"),
            ("   ", "no element"),
            ("<a><b></a>", "</a> closes <b> at its byte 6"),
            ("<a>", "ends within <a>"),
            ("<a", "ends within a tag"),
            ("<a b>", "a tag that is none at its byte 0"),
            ("<a b='<'>", "a tag that is none"),
            ("<a b='1>", "a tag that is none"),
            ("<a /x>", "a tag that is none"),
            ("x<a/>", "text outside of all elements at its byte 0"),
            ("<a><![CDATA[", "ends within CDATA"),
            ("<a><!-- ", "ends within <!--"),
            ("<!DOCTYPE a><a/>", "a document type"),
        ];
        for (text, words) in table {
            let why = told(text).unwrap_err();
            assert!(why.contains(words), "{text}: {why}");
        }
    }

    #[test]
    fn nothing_takes_the_square_of_its_length_or_the_stack() {
        assert!(told(&"<a>".repeat(1_000_000)).unwrap_err().contains("within each other"));
        let attributes: String = (0..100_000).map(|i| format!(" a{i}=\"'>\"")).collect();
        assert!(told(&format!("<a{attributes}/>")).is_ok());
        assert!(told(&format!("<a>{}</a>", "&".repeat(1_000_000))).is_ok());
        assert!(told(&format!("<a>{}</a>", "<b/>".repeat(1_000_000))).is_ok());
    }
}
