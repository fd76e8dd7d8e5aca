//! Every test that `docs/reliability.md` names exists: a promise without its test is none.
//!
//! Names are in backticks in the last column of tables whose last heading is `test`: parts of the path of a file and the name of a
//! test, as far as needed, between `::`, `/` or blanks. `*` stands for all tests there.

use std::fs;
use std::path::Path;

/// Parts of a path that say nothing.
const IDLE: [&str; 6] = ["crates", "src", "tests", "mod", "main", "lib"];

/// Parts of the path of each test, its name last.
fn tests_in(root: &Path) -> Vec<Vec<String>> {
    let is_built =
        |entry: &walkdir::DirEntry| ["target", "node_modules"].contains(&&*entry.file_name().to_string_lossy());
    let entries = walkdir::WalkDir::new(root).into_iter().filter_entry(|entry| !is_built(entry)).flatten();
    let sources = entries.filter(|entry| entry.path().extension().is_some_and(|e| e == "rs"));
    let tests = |entry: walkdir::DirEntry| {
        let path = parts(&entry.path().strip_prefix(root).unwrap().to_string_lossy());
        let text = fs::read_to_string(entry.path()).unwrap();
        let names = names(&text).into_iter().map(|name| [&path[..], &[name.to_owned()]].concat());
        names.collect::<Vec<_>>()
    };
    sources.flat_map(tests).collect()
}

/// Names of the test functions of a file.
fn names(source: &str) -> Vec<&str> {
    let behind = source.split("#[test]\n").skip(1);
    behind.filter_map(|text| text.split_once("fn ")?.1.split_once('(')).map(|(name, _)| name).collect()
}

fn parts(name: &str) -> Vec<String> {
    let name = name.replace("pointmill-", "").replace("pointmill_", "").replace(".rs", "");
    let parts = name.split(['/', ' ', ':', '\\']).filter(|part| !part.is_empty() && !IDLE.contains(part));
    parts.map(str::to_owned).collect()
}

/// Names in the last column of the tables of tests, and rows that have none.
fn named(document: &str) -> (Vec<&str>, Vec<&str>) {
    let (mut names, mut without, mut is_table) = (Vec::new(), Vec::new(), false);
    for line in document.lines() {
        let Some((_, cell)) = line.trim_end_matches([' ', '|']).rsplit_once('|') else {
            is_table = false;
            continue;
        };
        if is_table && !cell.trim().starts_with("---") {
            let before = names.len();
            names.extend(cell.split('`').skip(1).step_by(2));
            without.extend((names.len() == before).then_some(line));
        }
        is_table |= cell.trim() == "test";
    }
    (names, without)
}

/// Names that no test has.
fn missing<'a>(names: &[&'a str], tests: &[Vec<String>]) -> Vec<&'a str> {
    let exists = |name: &str| {
        let mut wanted = parts(name);
        let is_all = wanted.last().is_some_and(|last| last == "*");
        wanted.truncate(wanted.len() - usize::from(is_all));
        !wanted.is_empty() && tests.iter().any(|test| test.windows(wanted.len()).any(|part| part == wanted))
    };
    names.iter().copied().filter(|name| !exists(name)).collect()
}

#[test]
fn tests_named_by_the_promises_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let document = fs::read_to_string(root.join("docs/reliability.md")).unwrap();
    let (names, without) = named(&document);
    assert!(names.len() > 50, "{names:?}");
    assert_eq!(without, [""; 0], "promises without a test");
    assert_eq!(missing(&names, &tests_in(root)), [""; 0]);
}

#[test]
fn a_test_that_is_missing_is_found() {
    let tests: Vec<Vec<String>> = [
        ("tests/cli/stops.rs", "#[test]\nfn a_signal() {}\n#[test]\n#[ignore = \"long\"]\nfn kills() {"),
        ("crates/a/src/scan/las/mod.rs", "fn no_test() {}\n#[cfg(test)]\nmod tests {\n    #[test]\n    fn of_las() {"),
    ]
    .into_iter()
    .flat_map(|(path, text)| names(text).into_iter().map(move |name| parts(&format!("{path} {name}"))))
    .collect();
    let document = "| promise | test |\n|---|---|\n| `x` | `cli stops::a_signal`, `::kills`, `cli stops::*` |\n\
        | y | `pointmill-a scan::las::tests::of_las`, `las/`, `no_test`, `cli stop` |\n| z | none |\n\
        | w | `::a_sign` |\n\n| other | column |\n|---|---|\n| a | `b` |\n";
    let (names, without) = named(document);
    assert_eq!(missing(&names, &tests), ["no_test", "cli stop", "::a_sign"]);
    assert_eq!(without, ["| z | none |"]);
}
