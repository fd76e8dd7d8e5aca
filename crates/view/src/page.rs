//! The page: one text, made of the files of `page/`.

use std::path::{Path, PathBuf};
use std::{fs, io};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value};

/// How the page's generator begins, in its first lines: what tells it from the files of others.
pub const GENERATOR: &str = "<meta name=\"generator\" content=\"pointmill ";

/// The file of the page itself, with the marks below in it.
const INDEX: &str = "index.html";
const STYLE: &str = "style.css";

/// Where style, modules and settings are put into the page.
const STYLE_MARK: &str = "<!--style-->";
const MODULES_MARK: &str = "<!--importmap-->";
const CONFIG_MARK: &str = "<!--config-->";

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../page/", $name)))),*]
    };
}

/// Every file of `page/`, by its name below it.
const FILES: &[(&str, &str)] = files![
    "app.js",
    "camera.js",
    "clip.js",
    "clouds/batches.js",
    "clouds/bintree.js",
    "clouds/block.js",
    "clouds/loader.js",
    "clouds/octree.js",
    "clouds/open.js",
    "clouds/units.js",
    "controls.js",
    "cursor.js",
    "gl/context.js",
    "gl/palettes.js",
    "gl/renderer.js",
    "gl/shaders.js",
    "index.html",
    "main.js",
    "math.js",
    "recover.js",
    "sources/batches.js",
    "sources/bintree.js",
    "sources/columns.js",
    "sources/files.js",
    "sources/potree1.js",
    "sources/potree2.js",
    "sources/request.js",
    "sources/server.js",
    "sources/static.js",
    "sources/units.js",
    "style.css",
    "ui/elements.js",
    "ui/link.js",
    "ui/measure.js",
    "ui/messages.js",
    "ui/panel.js",
    "ui/picture.js",
    "ui/point.js",
];

/// Where the page comes from.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub enum PageSource {
    /// What was built in.
    #[default]
    BuiltIn,
    /// The files of a folder, read anew for every request: for those who work on the page.
    Folder(PathBuf),
}

impl PageSource {
    pub(crate) fn page(&self, config: &Value) -> io::Result<String> {
        match self {
            Self::BuiltIn => Ok(page(config)),
            Self::Folder(folder) => {
                let mut files = Vec::new();
                read_folder(folder, "", &mut files)?;
                files.sort();
                let files: Vec<(&str, &str)> =
                    files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
                Ok(assemble(&files, config))
            }
        }
    }
}

/// The page as one text that needs no other file: style, modules and settings are in it. `config` is what its program reads first:
/// `{"mode": "server", "scenes": ["api/0"], "version": "0.1.0"}`, or of a page beside a dataset
/// `{"mode": "static", "scenes": [{"kind": "potree2", "name": "scan", "url": "scan/"}], "version": "0.1.0"}`.
#[must_use]
pub fn page(config: &Value) -> String {
    assemble(FILES, config)
}

fn assemble(files: &[(&str, &str)], config: &Value) -> String {
    let text = |name: &str| files.iter().find(|(n, _)| *n == name).map_or("", |(_, text)| text);
    let version = env!("CARGO_PKG_VERSION");
    let style = format!("{GENERATOR}{version}\">\n<style>\n{}</style>", text(STYLE));
    let modules = files.iter().filter(|(name, _)| name.ends_with(".js"));
    let imports: Map<String, Value> = modules.map(|(name, text)| (format!("pm/{name}"), module(name, text))).collect();
    let imports = serde_json::json!({ "imports": imports });
    let modules = format!("<script type=\"importmap\">{}</script>", in_script(&imports));
    let config = format!("<script type=\"application/json\" id=\"config\">{}</script>", in_script(config));
    text(INDEX).replacen(STYLE_MARK, &style, 1).replacen(MODULES_MARK, &modules, 1).replacen(CONFIG_MARK, &config, 1)
}

/// A module as an address; the last line names it to debuggers.
fn module(name: &str, text: &str) -> Value {
    let text = format!("{text}\n//# sourceURL=pm/{name}");
    format!("data:text/javascript;base64,{}", STANDARD.encode(text)).into()
}

/// JSON that does not end the element that it is in.
fn in_script(json: &Value) -> String {
    json.to_string().replace('<', "\\u003c")
}

fn read_folder(folder: &Path, prefix: &str, files: &mut Vec<(String, String)>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            read_folder(&entry.path(), &format!("{name}/"), files)?;
        } else if [".html", ".js", ".css"].iter().any(|ending| name.ends_with(ending)) {
            files.push((name, fs::read_to_string(entry.path())?));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn folder() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("page")
    }

    #[test]
    fn every_file_of_the_page_is_built_in() {
        let mut files = Vec::new();
        read_folder(&folder(), "", &mut files).unwrap();
        files.sort();
        let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        let mut built_in: Vec<&str> = FILES.iter().map(|(name, _)| *name).collect();
        built_in.sort_unstable();
        assert_eq!(names, built_in, "the table FILES of page.rs");
        let config = json!({ "mode": "server" });
        assert_eq!(PageSource::Folder(folder()).page(&config).unwrap(), page(&config));
    }

    #[test]
    fn marks_are_replaced_and_modules_name_each_other() {
        let files = [
            ("index.html", "<head><!--style--><!--importmap--></head><!--config-->"),
            ("style.css", "a {}\n"),
            ("gl/points.js", "export const n = 1 < 2;"),
        ];
        let page = assemble(&files, &json!({ "name": "</script><b>" }));
        assert!(!page.contains("<!--"), "{page}");
        assert!(page.contains("<style>\na {}\n</style>"), "{page}");
        assert!(page.contains(r#"{"name":"\u003c/script>\u003cb>"}</script>"#), "{page}");
        let encoded = page.split("\"pm/gl/points.js\":\"data:text/javascript;base64,").nth(1).unwrap();
        let text = STANDARD.decode(encoded.split('"').next().unwrap()).unwrap();
        assert_eq!(text, b"export const n = 1 < 2;\n//# sourceURL=pm/gl/points.js");
    }

    #[test]
    fn the_page_is_known_by_its_first_lines() {
        let page = page(&json!({}));
        assert!(page.find(GENERATOR).is_some_and(|at| at < 4096), "{}", &page[..page.len().min(4096)]);
        for mark in [STYLE_MARK, MODULES_MARK, CONFIG_MARK] {
            assert!(FILES.iter().any(|(name, text)| *name == INDEX && text.contains(mark)), "{mark}");
        }
    }
}
