//! A folder to work in, and the program.

use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;

/// Options of every kind of output.
pub(crate) const OUTPUTS: [&[&str]; 8] = [
    &["--to", "potree2"],
    &["--to", "potree1"],
    &["--to", "potree1", "--archive"],
    &["--to", "copc"],
    &["--to", "bintree", "--capacity", "1000"],
    &["--to", "bintree", "--layout", "packed"],
    &["--to", "batches"],
    &["--to", "potree2", "--to", "bintree", "--to", "batches"],
];

/// One temporary folder per test.
pub(crate) struct Dir(tempfile::TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Names of everything in the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The program, about to be started in this folder.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
        command.args(args).current_dir(self.0.path()).env_remove("RUST_BACKTRACE");
        command
    }

    /// Runs the program in this folder.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        Ended(self.command(args).output().unwrap())
    }

    /// Runs the program, which must succeed.
    pub(crate) fn succeed<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        let ended = self.run(args);
        assert_eq!(ended.code(), 0, "{}", ended.stderr());
        ended
    }

    /// The run report of a dataset.
    pub(crate) fn report(&self, dataset: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(dataset).join("report.json")).unwrap()).unwrap()
    }

    /// Proves that the dataset is in order and holds the points of `inputs`.
    pub(crate) fn validate(&self, dataset: &str, inputs: &[&str]) {
        let mut args = vec!["validate", dataset, "-q"];
        if !inputs.is_empty() {
            args.push("--against");
            args.extend(inputs);
        }
        let ended = self.run(args);
        assert_eq!(ended.code(), 0, "{}{}", ended.stdout(), ended.stderr());
    }
}

/// A run that has ended.
pub(crate) struct Ended(pub(crate) Output);

impl Ended {
    pub(crate) fn code(&self) -> i32 {
        self.0.status.code().unwrap_or_else(|| panic!("{:?}: {}", self.0.status, self.stderr()))
    }

    pub(crate) fn stdout(&self) -> String {
        String::from_utf8(self.0.stdout.clone()).unwrap()
    }

    pub(crate) fn stderr(&self) -> String {
        String::from_utf8(self.0.stderr.clone()).unwrap()
    }

    /// Asserts that the run failed with `code` and one line that holds all of `words`.
    pub(crate) fn failed_with(&self, code: i32, words: &[&str]) {
        let stderr = self.stderr();
        assert_eq!(self.code(), code, "{stderr}");
        let line = stderr.lines().last().unwrap_or_default();
        assert!(line.starts_with("error: "), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        for word in words {
            assert!(line.contains(word), "`{word}` is not in: {line}");
        }
    }
}
