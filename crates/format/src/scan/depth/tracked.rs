//! A file that a decoder reads, and how far it has come: errors name the byte.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::rc::Rc;

use crate::ReadError;

/// Bytes that were read of a file so far, also while somebody else has the file.
pub(super) type Place = Rc<Cell<u64>>;

/// A file with its place.
pub(super) struct Tracked {
    file: BufReader<File>,
    place: Place,
}

impl Tracked {
    pub(super) fn open(path: &Path) -> Result<(Self, Place), ReadError> {
        let file = File::open(path).map_err(|e| ReadError::io(path, "opening the picture", e))?;
        let place = Place::default();
        Ok((Self { file: BufReader::new(file), place: Rc::clone(&place) }, place))
    }

    fn advance(&self, bytes: usize) {
        self.place.set(self.place.get() + bytes as u64);
    }
}

impl Read for Tracked {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        let bytes = self.file.read(buf)?;
        self.advance(bytes);
        Ok(bytes)
    }
}

impl BufRead for Tracked {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.file.fill_buf()
    }

    fn consume(&mut self, bytes: usize) {
        self.file.consume(bytes);
        self.advance(bytes);
    }
}

impl Seek for Tracked {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = self.file.seek(to)?;
        self.place.set(place);
        Ok(place)
    }
}
