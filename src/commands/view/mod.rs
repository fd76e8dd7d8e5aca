//! `pointmill view`: datasets and scans in the browser.

mod scans;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

use pointmill_format::Located;
use pointmill_view::{Dataset, Event, Options, Server};
use serde_json::json;

use crate::args::ViewArgs;
use crate::datasets;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::interrupt;
use scans::Made;

/// Lines about broken datasets that are printed; a browser asks again and again.
const MOST_LINES: usize = 50;

pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    let (found, scans) = sort(args)?;
    // before anything takes long: a port that is taken
    let server = Server::bind(options(args))?;
    let mut datasets = found.iter().map(Dataset::of_located).collect::<Result<Vec<_>, _>>()?;
    let made = if scans.is_empty() { None } else { Some(Made::of(args, &scans)?) };
    if let Some(made) = &made {
        datasets.push(Dataset::open(made.folder())?);
    }
    let stop = interrupt::stop_flag();
    announce(args, &server, &datasets)?;
    server.run(datasets, || stop.load(Ordering::Relaxed))?;
    interrupt::settling();
    if made.as_ref().is_some_and(Made::is_temporary) {
        interrupt::tell_of_cleaning(interrupt::cleaning_line);
    }
    drop(made);
    Err(Failure::Interrupted("interrupted; the server has stopped".to_owned()))
}

/// Datasets, and what has to be converted first. Datasets whose points are to be moved are read as scans.
fn sort(args: &ViewArgs) -> Result<(Vec<Located>, Vec<PathBuf>), Failure> {
    let (mut found, mut scans) = (Vec::new(), Vec::new());
    for path in args.inputs.typed()? {
        let dataset = if args.inputs.reading.given().is_some() { None } else { datasets::named(&path)? };
        match dataset {
            Some(dataset) => found.push(dataset),
            None => scans.push(path),
        }
    }
    if found.is_empty() && scans.is_empty() {
        return Err(Failure::Usage(
            "no input: pass datasets, scans, folders or globs, or --files-from LIST".to_owned(),
        ));
    }
    if args.keep && scans.is_empty() {
        return Err(Failure::Usage("--keep is for scans; these are datasets".to_owned()));
    }
    Ok((found, scans))
}

fn options(args: &ViewArgs) -> Options {
    let told = Mutex::new(HashSet::new());
    let threads = args.threads.map_or(0, |n| n.get().into());
    Options::default().port(args.port.unwrap_or(0)).threads(threads).events(move |event| {
        if let Event::Failed(line) = event {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            if told.len() < MOST_LINES && told.insert(line.clone()) {
                print_line(&line);
            }
        }
    })
}

/// Prints the address, and opens it.
fn announce(args: &ViewArgs, server: &Server, datasets: &[Dataset]) -> Result<(), Failure> {
    let url = server.url();
    if args.json {
        let paths: Vec<String> = datasets.iter().map(|d| Path::to_string_lossy(d.path()).into_owned()).collect();
        emit(&to_json(&json!({ "url": url, "datasets": paths }))?)?;
    } else {
        emit(&format!("{url}\n"))?;
    }
    if !args.no_open {
        // connections wait until the server runs
        let opened = std::thread::Builder::new().spawn(move || {
            if let Err(error) = open::that_detached(&url) {
                print_line(&format!("no browser could be opened ({error}); open {url} in one"));
            }
        });
        drop(opened);
    }
    if !args.talk.quiet {
        print_line("Ctrl-C stops the server");
    }
    Ok(())
}
