//! `pointmill extract`: the images within a file of scans as files, and the places of scans and images as a table.

mod names;
mod poses;
mod staging;

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use pointmill_format::scan::e57;
use pointmill_format::{Blob, ImageEncoding, OpenOptions, ReadError, ScanImage, ScanInfo, ScanKind, open_scan};

use crate::args::{ExtractArgs, FaultArg};
use crate::exit::{Failure, print_line};
use crate::flags;
use crate::human::quantities::plural;
use crate::scan_choice;
use poses::Row;
use staging::Staging;

/// The table.
const POSES: &str = "poses.csv";

/// Writes everything or nothing: files appear in the folder once all of them are complete.
pub(crate) fn run(args: &ExtractArgs) -> Result<(), Failure> {
    let file = args.file.as_path();
    match fs::metadata(file) {
        Ok(meta) if meta.is_dir() => {
            return Err(Failure::Io(format!("{}: this is a folder; name one scan in it", file.display())));
        }
        Ok(_) => {}
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(Failure::Usage(format!("{}: no such file", file.display())));
        }
        Err(e) => return Err(Failure::io(file, "reading the input", &e)),
    }
    let mut options = OpenOptions::default();
    options.scans = (!args.scans.is_empty()).then(|| args.scans.clone());
    scan_choice::check(std::slice::from_ref(&args.file), &options)?;
    let scan = open_scan(file, &options)?;
    let info = scan.info();
    if info.parts.is_empty() && ScanKind::of_file(file)? != Some(ScanKind::E57) {
        let line = format!("{}: {}: there are no scans or images within it; E57 has them", file.display(), info.format);
        return Err(Failure::Unsupported(line));
    }
    let numbers: Vec<usize> = info.parts.iter().map(|part| part.number).collect();
    let is_wanted = |image: &&ScanImage| args.scans.is_empty() || image.scan.is_some_and(|n| numbers.contains(&n));
    let images: Vec<&ScanImage> = info.images.iter().filter(is_wanted).collect();
    let mut staging = Staging::new(&args.output)?;
    let written = write(args, info, &images, &mut staging)?;
    staging.finish(args.overwrite)?;
    if !args.quiet {
        notes(info, args, &written).iter().for_each(|note| print_line(note));
    }
    Ok(())
}

/// What was written, and what is to be told of it.
#[derive(Default)]
struct Written {
    images: u64,
    masks: u64,
    rows: u64,
    notes: Vec<String>,
}

fn write(
    args: &ExtractArgs,
    info: &ScanInfo,
    images: &[&ScanImage],
    staging: &mut Staging,
) -> Result<Written, Failure> {
    let mut written = Written::default();
    let mut rows: Vec<Row> = info.parts.iter().map(Row::of_scan).collect();
    for image in images {
        let mut row = Row::of_image(image);
        match extract(&args.file, image, staging, &mut written) {
            Ok((name, mask)) => (row.file, row.mask) = (name, mask),
            Err(Fault::Source(error)) if args.unreadable == FaultArg::Skip => {
                written.notes.push(format!("image {} is skipped: {}", image.number, flags::read_error_line(&error)));
            }
            Err(Fault::Source(error)) => return Err(error.into()),
            Err(Fault::Target(failure)) => return Err(failure),
        }
        rows.push(row);
    }
    written.rows = rows.len() as u64;
    staging.write(POSES, &mut |sink| sink(poses::table(&rows).as_bytes()))?;
    Ok(written)
}

/// Why an image was not written.
enum Fault {
    Source(ReadError),
    Target(Failure),
}

impl From<Failure> for Fault {
    fn from(failure: Failure) -> Self {
        Self::Target(failure)
    }
}

/// Writes an image and its mask; their names.
fn extract(
    file: &Path,
    image: &ScanImage,
    staging: &mut Staging,
    written: &mut Written,
) -> Result<(String, String), Fault> {
    let encoding = encoding(file, &image.data).map_err(Fault::Source)?;
    if encoding.is_some_and(|found| found != image.encoding) {
        let (number, declared) = (image.number, image.encoding.name());
        let found = encoding.map_or("", ImageEncoding::name);
        written.notes.push(format!("image {number} is declared as {declared} and is {found}; it is named so"));
    }
    let name = names::image(image, encoding.unwrap_or(image.encoding));
    copy(file, &image.data, &name, staging)?;
    written.images += 1;
    let Some(mask) = &image.mask else { return Ok((name, String::new())) };
    let mask_name = names::mask(image);
    copy(file, mask, &mask_name, staging)?;
    written.masks += 1;
    Ok((name, mask_name))
}

/// What the bytes of an image say of their encoding.
fn encoding(file: &Path, blob: &Blob) -> Result<Option<ImageEncoding>, ReadError> {
    let mut found = None;
    e57::read_blob(file, blob, &mut |bytes| {
        found = ImageEncoding::of(bytes);
        ControlFlow::Break(())
    })?;
    Ok(found)
}

fn copy(file: &Path, blob: &Blob, name: &str, staging: &mut Staging) -> Result<(), Fault> {
    let mut source = Ok(());
    staging.write(name, &mut |sink| {
        let mut target = Ok(());
        source = e57::read_blob(file, blob, &mut |bytes| {
            target = sink(bytes);
            if target.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        target
    })?;
    if source.is_err() {
        staging.forget(name);
    }
    source.map_err(Fault::Source)
}

fn notes(info: &ScanInfo, args: &ExtractArgs, written: &Written) -> Vec<String> {
    let output = args.output.display();
    let table = format!("{POSES} has {}", plural(written.rows, "row"));
    let masks = if written.masks == 0 { String::new() } else { format!(" and {}", plural(written.masks, "mask")) };
    let mut notes = written.notes.clone();
    notes.push(match written.images {
        0 if info.images.is_empty() => format!("{output}: there are no images in the file; {table}, one for each scan"),
        0 => format!("{output}: no image was written; {table}"),
        n => format!("{output}: {}{masks} written; {table}", plural(n, "image")),
    });
    notes
}
