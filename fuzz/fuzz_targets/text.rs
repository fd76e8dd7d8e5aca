//! XYZ, PTS, PTX and OFF, detected by content. The first byte chooses the options for the columns.

#![no_main]

use pointmill_format::scan::text::{self, TextOptions};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((choice, file)) = bytes.split_first() else { return };
    match choice {
        b'1' => pointmill_fuzz::read(file, |path| open(path, Some("x,y,z,i"), None)),
        b'2' => pointmill_fuzz::read(file, |path| open(path, Some("r,g,b,x,y,z,c,q:uint8"), None)),
        b'3' => pointmill_fuzz::read(file, |path| open(path, Some("x,-,y,id:uint64"), Some(','))),
        b'4' => pointmill_fuzz::read(file, |path| open(path, None, Some(';'))),
        _ => pointmill_fuzz::read(file, |path| open(path, None, None)),
    }
});

fn open(
    path: &std::path::Path,
    columns: Option<&str>,
    separator: Option<char>,
) -> Result<Box<dyn pointmill_format::Scan>, pointmill_format::ReadError> {
    let mut options = TextOptions::default();
    options.columns = columns.map(|list| list.split(',').map(str::to_owned).collect());
    options.separator = separator;
    text::open(path, &options)
}
