//! Names in the documents exist: files, folders and options.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Options in the documents that are not pointmill's: of cargo, and of the programs and scripts in the bench crate.
const OTHER_OPTIONS: &[&str] = &[
    "--as",
    "--all-features",
    "--bin",
    "--bench",
    "--dir",
    "--example",
    "--features",
    "--format",
    "--ignored",
    "--jobs",
    "--kills",
    "--lend",
    "--locked",
    "--note",
    "--only",
    "--options",
    "--out",
    "--path",
    "--points",
    "--profile",
    "--quality",
    "--raise",
    "--release",
    "--runs",
    "--scene",
    "--test",
    "--workspace",
];

/// Files and folders below `folder`, relative to it, without what is built or hidden.
fn tree(folder: &Path) -> BTreeSet<String> {
    let visible = |entry: &walkdir::DirEntry| {
        let name = entry.file_name().to_string_lossy();
        let foreign = ["target", "corpus", "node_modules"].contains(&name.as_ref());
        entry.depth() == 0 || name == ".ci" || !(name.starts_with('.') || foreign)
    };
    let entries = walkdir::WalkDir::new(folder).into_iter().filter_entry(visible).filter_map(Result::ok);
    entries.map(|e| e.path().strip_prefix(folder).unwrap().to_string_lossy().replace('\\', "/")).collect()
}

/// Names of files and folders in backticks that no path in `tree` ends with.
fn missing_names<'a>(document: &'a str, tree: &BTreeSet<String>) -> Vec<&'a str> {
    let is_name = |text: &&str| {
        let is_path = text.chars().all(|c| c.is_ascii_alphanumeric() || "/._-".contains(c)) && !text.starts_with("..");
        let is_file = [".rs", ".md", ".toml", ".json"].iter().any(|end| text.ends_with(end));
        is_path && (text.contains('/') || is_file)
    };
    let exists = |name: &str| {
        let name = name.trim_end_matches('/');
        tree.iter().any(|path| path.strip_suffix(name).is_some_and(|rest| rest.is_empty() || rest.ends_with('/')))
    };
    document.split('`').skip(1).step_by(2).filter(is_name).filter(|name| !exists(name)).collect()
}

/// Long options in a text, with their dashes.
fn options(text: &str) -> BTreeSet<&str> {
    let is_option = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices("--") {
        let before = text[..at].chars().next_back().unwrap_or(' ');
        let rest = &text[at..];
        let end = rest.find(|c| !is_option(c)).unwrap_or(rest.len());
        let option = rest[..end].trim_end_matches('-');
        if (before.is_whitespace() || "`('\"".contains(before)) && option.len() > 3 && !option.starts_with("---") {
            found.insert(option);
        }
    }
    found
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn files_and_folders_named_in_the_architecture_exist() {
    let document = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    assert_eq!(missing_names(&document, &tree(root())), [""; 0]);
}

#[test]
fn options_named_in_the_documents_exist() {
    let mut help = String::new();
    let commands = "convert/export/measure/validate/info/extract/preview/view/job plan/job units/job run/job finish";
    for command in commands.split('/') {
        let words = command.split(' ').chain(["--help"]);
        let output = Command::new(env!("CARGO_BIN_EXE_pointmill")).args(words).output().unwrap();
        help += &String::from_utf8(output.stdout).unwrap();
    }
    let known = options(&help);
    assert!(known.contains("--lod-cell") && known.contains("--against") && known.contains("--deep"), "{known:?}");
    let documents = tree(root()).into_iter().filter(|path| {
        path == "README.md" || path == "ARCHITECTURE.md" || path.starts_with("docs/") && path.ends_with(".md")
    });
    for name in documents {
        let document = std::fs::read_to_string(root().join(&name)).unwrap();
        let unknown: Vec<&str> =
            options(&document).into_iter().filter(|o| !known.contains(o) && !OTHER_OPTIONS.contains(o)).collect();
        assert!(unknown.is_empty(), "{name}: {unknown:?}");
    }
}

#[test]
fn a_name_that_is_missing_is_found() {
    let tree = BTreeSet::from(["crates/a/src/b/mod.rs".to_owned(), "crates/a/src/b".to_owned()]);
    let document = "`b/` has `b/mod.rs`, `c.rs`, `crates/c`, `Plan`, `mod.rs`, `od.rs`, `../shared/x`";
    assert_eq!(missing_names(document, &tree), ["c.rs", "crates/c", "od.rs"]);
    let text = "(--one) `--two-x 3` a--b --- |---| [--deep] --x\n--four";
    assert_eq!(options(text), BTreeSet::from(["--one", "--two-x", "--four"]));
}
