//! Files that are no scans and look like text of points, or are called like scans.

use std::fmt;

#[cfg(feature = "depth")]
use crate::scan::depth::is_depth;

/// What a file is that may be taken for a scan by its rows of numbers or by its extension, and is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OtherKind {
    /// Esri's (Arc/Info) ASCII grid.
    ArcGrid,
    /// GRASS's ASCII raster.
    GrassGrid,
    /// Golden Software's grid, as text or binary.
    SurferGrid,
    /// Netpbm image.
    Netpbm,
    /// PNG picture that is no depth map.
    Png,
    /// JPEG picture.
    Jpeg,
    /// Log ASCII Standard: measurements in a borehole, `.las` as lidar.
    WellLog,
}

/// First bytes of pictures.
const PICTURES: [(&[u8], OtherKind); 2] = [(b"\x89PNG\r\n\x1a\n", OtherKind::Png), (b"\xff\xd8\xff", OtherKind::Jpeg)];

/// Without their reader they are pictures like others.
#[cfg(not(feature = "depth"))]
const fn is_depth(_: &[u8]) -> bool {
    false
}

impl OtherKind {
    /// What a file is that starts with these bytes (give some kB); `None`: nothing that is known here.
    #[must_use]
    pub fn of(first_bytes: &[u8]) -> Option<Self> {
        if let Some((_, picture)) = PICTURES.iter().find(|(start, _)| first_bytes.starts_with(start)) {
            return (!is_depth(first_bytes)).then_some(*picture);
        }
        let lines: Vec<Vec<u8>> = first_bytes
            .split(|b| matches!(b, b'\n' | b'\r'))
            .map(|line| line.trim_ascii().to_ascii_lowercase())
            .filter(|line| !line.is_empty())
            .take(12)
            .collect();
        let first = lines.first()?;
        let has = |keyword: &str, lines: &[Vec<u8>]| {
            let value = |line: &Vec<u8>| Some(line.strip_prefix(keyword.as_bytes())?.first()?.is_ascii_whitespace());
            lines.iter().any(|line| value(line) == Some(true))
        };
        let head = &lines[..lines.len().min(8)];
        if [b"dsaa", b"dsbb", b"dsrb"].iter().any(|id| first.starts_with(*id)) {
            return Some(Self::SurferGrid);
        }
        if (has("ncols", &lines[..1]) || has("nrows", &lines[..1])) && has("ncols", head) && has("nrows", head) {
            return Some(Self::ArcGrid);
        }
        if ["north:", "south:", "rows:", "cols:"].into_iter().all(|keyword| has(keyword, head)) {
            return Some(Self::GrassGrid);
        }
        if matches!(first.as_slice(), [b'p', b'1'..=b'6', rest @ ..] if rest.first().is_none_or(u8::is_ascii_whitespace))
        {
            return Some(Self::Netpbm);
        }
        lines.iter().find(|line| !line.starts_with(b"#")).filter(|line| line.starts_with(b"~v")).map(|_| Self::WellLog)
    }
}

impl fmt::Display for OtherKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ArcGrid => "an Arc/Info ASCII grid, a raster",
            Self::GrassGrid => "a GRASS ASCII grid, a raster",
            Self::SurferGrid => "a Surfer grid, a raster",
            Self::Netpbm => "a Netpbm image, a raster",
            Self::Png => "a PNG picture, and no depth map (16-bit grey)",
            Self::Jpeg => "a JPEG picture",
            Self::WellLog => "a well log (Log ASCII Standard)",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rasters_and_logs_are_told_from_points() {
        for (bytes, expected) in [
            (&b"ncols 4\nnrows 6\nxllcorner 0\nyllcorner 0\ncellsize 30\n1 2 3 4\n"[..], Some(OtherKind::ArcGrid)),
            (b"NCOLS        4\r\nNROWS 6\r\nXLLCENTER 0\r\n", Some(OtherKind::ArcGrid)),
            (b"nrows 6\nncols 4\n", Some(OtherKind::ArcGrid)),
            (b"north: 4\nsouth: 0\neast: 1\nwest: 0\nrows: 2\ncols: 2\n1 2\n", Some(OtherKind::GrassGrid)),
            (b"DSAA\n3 2\n0 1\n", Some(OtherKind::SurferGrid)),
            (b"P2\n4 6\n255\n1 2 3 4\n", Some(OtherKind::Netpbm)),
            (b"# made by\n~Version Information\n VERS. 2.0\n", Some(OtherKind::WellLog)),
            (b"\xff\xd8\xff\xe0 ....JFIF", Some(OtherKind::Jpeg)),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x02\0\0\0\x02\x08\x02\0\0\0", Some(OtherKind::Png)),
            (b"ncols nrows z\n1 2 3\n", None),
            (b"P21 2 3\n", None),
            (b"1 2 3\n", None),
            (b"", None),
        ] {
            assert_eq!(OtherKind::of(bytes), expected, "{:?}", String::from_utf8_lossy(bytes));
        }
    }
}
