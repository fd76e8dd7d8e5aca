//! `pointmill completions` and `pointmill man`: both are made of the same definitions as `--help`.

use std::fs;
use std::io::{self, Write as _};

use clap::{Command, CommandFactory as _};

use crate::args::{Args, CompletionsArgs, ManArgs};
use crate::exit::Failure;

const PROGRAM: &str = "pointmill";

/// Writes the script of a shell to standard output.
pub(crate) fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), PROGRAM, &mut script);
    to_stdout(&script)
}

/// Writes manual pages: all into a folder, or the main one to standard output.
pub(crate) fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut command = Args::command();
    command.build();
    let Some(folder) = &args.output else { return to_stdout(&page(command, PROGRAM)?) };
    fs::create_dir_all(folder).map_err(|e| Failure::io(folder, "making the folder", &e))?;
    let commands: Vec<Command> = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    let pages = commands.into_iter().map(|sub| (format!("{PROGRAM}-{}", sub.get_name()), sub));
    for (name, command) in std::iter::once((PROGRAM.to_owned(), command)).chain(pages) {
        let path = folder.join(format!("{name}.1"));
        let page = page(command, &name)?;
        fs::write(&path, page).map_err(|e| Failure::io(&path, "writing", &e))?;
    }
    Ok(())
}

fn page(command: Command, name: &str) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    let command = command.version(env!("CARGO_PKG_VERSION"));
    let rendered = clap_mangen::Man::new(command).title(name.to_uppercase()).render(&mut page);
    rendered.map(|()| page).map_err(|e| Failure::Internal(format!("the manual page of {name}: {e}")))
}

fn to_stdout(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Io(format!("standard output: {}", pointmill_format::system_reason(&e))))
        }
        _ => Ok(()),
    }
}
