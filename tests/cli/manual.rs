//! Completions and manual pages.

use std::process::Command;

use crate::support::Dir;

#[test]
fn every_shell_gets_a_script_that_knows_the_options() {
    let dir = Dir::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = dir.succeed(["completions", shell]).stdout();
        assert!(script.contains("convert") && script.contains("brotli-quality"), "{shell}: {script}");
    }
    dir.write("script.bash", dir.succeed(["completions", "bash"]).stdout().as_bytes());
    if let Ok(bash) = Command::new("bash").arg("-n").arg(dir.path("script.bash")).output() {
        assert!(bash.status.success(), "{}", String::from_utf8_lossy(&bash.stderr));
    }
}

#[test]
fn there_is_a_manual_page_for_each_command() {
    let dir = Dir::new();
    let main = dir.succeed(["man"]).stdout();
    assert!(main.contains(".TH POINTMILL 1") && main.contains("pointmill\\-convert(1)"), "{main}");
    dir.succeed(["man", "-o", "pages"]);
    let help = dir.succeed(["--help"]).stdout();
    let commands: Vec<&str> =
        help.split("Commands:").nth(1).unwrap().lines().skip(1).take_while(|l| !l.is_empty()).collect();
    let mut names: Vec<&str> = commands
        .iter()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 8, "{help}");
    for name in names.drain(..) {
        let page = std::fs::read_to_string(dir.path(&format!("pages/pointmill-{name}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains(&name.to_uppercase()), "{page}");
    }
}

#[test]
fn an_unwritable_folder_is_one_line() {
    let dir = Dir::new();
    dir.write("taken", b"a file");
    let ended = dir.run(["man", "-o", "taken/pages"]);
    assert_eq!(ended.code(), 5);
    assert!(ended.stderr().starts_with("error: taken/pages: "), "{}", ended.stderr());
    assert_eq!(ended.stderr().lines().count(), 1);
}
