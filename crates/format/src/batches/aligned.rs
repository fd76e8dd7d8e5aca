//! Bytes in memory that can be looked at as words.

use std::io::Read;
use std::path::Path;

use crate::ReadError;
use crate::bytes::open_file;

/// A buffer whose start is aligned to 8 bytes, as the sections of [`super::Batches`] need it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AlignedBytes {
    words: Vec<u64>,
    len: usize,
}

impl AlignedBytes {
    /// All bytes of a file.
    ///
    /// # Errors
    /// The file cannot be read, or does not fit memory.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let io = |doing: &'static str| move |e| ReadError::io(path, doing, e);
        let mut file = open_file(path).map_err(io("opening"))?;
        let size = file.metadata().map_err(io("asking for the size"))?.len();
        let mut bytes = Self::with_size(size, path)?;
        file.read_exact(bytes.as_mut()).map_err(io("reading"))?;
        Ok(bytes)
    }

    /// Zeros of that size; `path` is for messages.
    pub(crate) fn with_size(size: u64, path: &Path) -> Result<Self, ReadError> {
        let mut bytes = Self::default();
        usize::try_from(size).ok().and_then(|len| bytes.try_resize(len).ok()).ok_or_else(|| {
            let what = format!("{size} bytes do not fit memory");
            ReadError::unsupported(path, what).advise("map the file instead of reading it (feature mmap)")
        })?;
        Ok(bytes)
    }

    /// Makes it `len` bytes long; new ones are 0.
    pub(crate) fn try_resize(&mut self, len: usize) -> Result<(), std::collections::TryReserveError> {
        let words = len.div_ceil(8);
        self.words.try_reserve(words.saturating_sub(self.words.len()))?;
        self.words.resize(words, 0);
        self.len = len;
        Ok(())
    }
}

impl From<&[u8]> for AlignedBytes {
    fn from(bytes: &[u8]) -> Self {
        let mut aligned = Self { words: vec![0; bytes.len().div_ceil(8)], len: bytes.len() };
        aligned.as_mut().copy_from_slice(bytes);
        aligned
    }
}

impl AsRef<[u8]> for AlignedBytes {
    fn as_ref(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }
}

impl AsMut<[u8]> for AlignedBytes {
    fn as_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_whatever_their_number() {
        for len in 0..20 {
            let bytes: Vec<u8> = (0..len).collect();
            let aligned = AlignedBytes::from(bytes.as_slice());
            assert_eq!(aligned.as_ref(), bytes);
            assert_eq!(aligned.as_ref().as_ptr().align_offset(8), 0);
        }
    }
}
