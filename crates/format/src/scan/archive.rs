//! Archives and compressed files, by their first bytes: they may hold scans, but are none.

/// First bytes, and what a file that has them is.
const STARTS: [(&[u8], &str); 11] = [
    (b"\x1f\x8b", "a gzip file"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"PK\x05\x06", "a ZIP archive"),
    (b"PK\x07\x08", "a ZIP archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard file"),
    (b"\xfd7zXZ\0", "an XZ file"),
    (b"Rar!\x1a\x07", "a RAR archive"),
    (b"\x04\x22\x4d\x18", "an LZ4 file"),
    (b"\x1f\x9d", "a file of compress (.Z)"),
    (b"LZIP", "an lzip file"),
];

/// bzip2: the block size stands between its word and the start of a block, or of the end.
const BZIP2: (&[u8], [&[u8]; 2]) = (b"BZh", [b"\x31\x41\x59\x26\x53\x59", b"\x17\x72\x45\x38\x50\x90"]);

/// Where a tar file says that it is one.
const TAR_AT: usize = 257;

/// What the file is that starts with these bytes, if it is an archive or compressed: "a gzip file".
pub(super) fn archive(first_bytes: &[u8]) -> Option<&'static str> {
    let (word, blocks) = BZIP2;
    let is_bzip2 = first_bytes.starts_with(word)
        && first_bytes.get(4..10).is_some_and(|b| blocks.contains(&b))
        && first_bytes.get(3).is_some_and(u8::is_ascii_digit);
    if is_bzip2 {
        return Some("a bzip2 file");
    }
    if first_bytes.get(TAR_AT..).is_some_and(|b| b.starts_with(b"ustar")) {
        return Some("a tar archive");
    }
    STARTS.iter().find(|(start, _)| first_bytes.starts_with(start)).map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn archives_are_told_by_their_first_bytes() {
        let tar = [[b'a'; 257].as_slice(), b"ustar\x0000"].concat();
        let cases: [(&[u8], Option<&str>); 9] = [
            (b"\x1f\x8b\x08\x08rest", Some("a gzip file")),
            (b"PK\x03\x04\x14\0", Some("a ZIP archive")),
            (b"7z\xbc\xaf\x27\x1c\0\x04", Some("a 7-Zip archive")),
            (b"BZh91AY&SY\0", Some("a bzip2 file")),
            (b"BZh9 is no magic", None),
            (b"\x28\xb5\x2f\xfd\x04", Some("a Zstandard file")),
            (&tar, Some("a tar archive")),
            (b"ply\nformat", None),
            (b"", None),
        ];
        for (bytes, expected) in cases {
            assert_eq!(archive(bytes), expected, "{:?}", String::from_utf8_lossy(bytes));
        }
    }
}
