//! The page beside a dataset, which shows it from any web server.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use pointmill_converter::resolve_path;
use pointmill_view::{GENERATOR, page};
use serde_json::json;

use super::whole_file::{beside, is_of_dataset};
use crate::args::{ConvertArgs, TargetArg};
use crate::exit::Failure;

/// The generator stands within this many bytes of a page.
const GENERATOR_WITHIN: u64 = 4096;

/// The page of a conversion.
pub(super) struct PageFile {
    /// As it is shown.
    shown: PathBuf,
    /// Resolved before the run, which may move the working folder.
    path: PathBuf,
    kind: TargetArg,
    /// The dataset, relative to the page.
    url: String,
    overwrite: bool,
}

impl PageFile {
    /// Refuses what a page without a server behind it cannot show.
    pub(super) fn check_formats(args: &ConvertArgs) -> Result<(), Failure> {
        let [kind] = args.to[..] else {
            return Err(Failure::Usage("--page is for one format; convert to the others without it".to_owned()));
        };
        let what = match kind {
            TargetArg::Copc => "COPC",
            TargetArg::Batches if args.batches.compress.is_some() => "compressed batches",
            TargetArg::Potree1 if args.potree1.archive => "an archive",
            _ => return Ok(()),
        };
        Err(Failure::Unsupported(format!(
            "--page: a page on a web server cannot decode {what}; leave out --page and look at it with `pointmill view`"
        )))
    }

    /// Checks, before the run, that the page that was requested has a place.
    pub(super) fn requested(args: &ConvertArgs) -> Result<Option<Self>, Failure> {
        if !args.page {
            return Ok(None);
        }
        Self::check_formats(args)?;
        let nowhere =
            |path: &Path| Failure::Usage(format!("{}: there is no place for a page beside it", path.display()));
        let output = resolve_path(&args.output).map_err(|_| nowhere(&args.output))?;
        let name = output.file_name().ok_or_else(|| nowhere(&output))?;
        let mut file = name.to_owned();
        file.push(".html");
        let path = output.with_file_name(&file);
        let url = format!("{}/", segment(&name.to_string_lossy()));
        let kind = args.to.first().copied().unwrap_or(TargetArg::Potree2);
        let shown = args.output.with_file_name(&file);
        let page = Self { shown, path, kind, url, overwrite: args.overwrite };
        page.check()?;
        Ok(Some(page))
    }

    /// What stands in its place must be such a page.
    fn check(&self) -> Result<(), Failure> {
        let refuse = |what: &str| Failure::Usage(format!("{}: {what}", self.shown.display()));
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if is_of_dataset(&self.path, &name) {
            return Err(refuse("the page would replace a file of a dataset; choose another output"));
        }
        let Ok(meta) = fs::symlink_metadata(&self.path) else { return Ok(()) };
        if !meta.is_file() || !is_page(&self.path) {
            return Err(refuse(
                "what is there is no page of pointmill and is not replaced; move it, or choose another output",
            ));
        }
        if self.overwrite { Ok(()) } else { Err(refuse("the page exists already; pass --overwrite to replace it")) }
    }

    /// Writes it, for a dataset of that name.
    pub(super) fn write(self, name: &str) -> Result<PathBuf, Failure> {
        let scene = json!({ "kind": self.kind.name(), "name": name, "url": self.url });
        let text = page(&json!({ "mode": "static", "scenes": [scene], "version": env!("CARGO_PKG_VERSION") }));
        let write = || {
            let mut new = beside(&self.path, ".page-")?;
            new.write_all(text.as_bytes())?;
            new.as_file().sync_all()?;
            let placed = if self.overwrite { new.persist(&self.path) } else { new.persist_noclobber(&self.path) };
            placed.map(drop).map_err(|e| e.error)
        };
        write().map_err(|error: io::Error| Failure::io(&self.shown, "writing the page", &error))?;
        Ok(self.shown)
    }
}

fn is_page(path: &Path) -> bool {
    let mut first = Vec::new();
    let read = File::open(path).and_then(|file| file.take(GENERATOR_WITHIN).read_to_end(&mut first));
    read.is_ok() && (first.is_empty() || first.windows(GENERATOR.len()).any(|part| part == GENERATOR.as_bytes()))
}

/// A name as a part of an address.
fn segment(name: &str) -> String {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'.' | b'_' | b'~');
    let part = |b: u8| if is_plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") };
    name.bytes().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_addresses() {
        assert_eq!(segment("Süd 1%.v2"), "S%C3%BCd%201%25.v2");
    }

    #[test]
    fn pages_are_known_by_their_first_lines() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("x.html");
        for (text, expected) in [(page(&json!({})), true), (String::new(), true), ("<html>".to_owned(), false)] {
            fs::write(&file, text).unwrap();
            assert_eq!(is_page(&file), expected);
        }
    }
}
