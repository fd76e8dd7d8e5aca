//! One door for scans of every kind that this build reads.

use std::fmt;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

use super::archive::archive;
use super::mapped::ScanMaps;
use super::other_kind::OtherKind;
use crate::{Advice, Decimal, DepthOptions, Fault, ReadError, Scan, UnknownName};

/// Maximum bytes from the start of a file to detect its kind; text needs some lines.
const SNIFF_BYTES: u64 = 4 << 10;

/// The kinds of scans, detected by content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScanKind {
    /// LAS and LAZ, COPC files among them.
    #[cfg(feature = "las")]
    Las,
    /// ASTM E57.
    #[cfg(feature = "e57")]
    E57,
    /// PLY, ascii and binary.
    #[cfg(feature = "ply")]
    Ply,
    /// PCD, ascii, binary and compressed.
    #[cfg(feature = "pcd")]
    Pcd,
    /// Lines of numbers.
    #[cfg(feature = "text")]
    Text(crate::scan::text::TextKind),
    /// Depth maps: PNG pictures of 16-bit grey, and folders of them with a trajectory.
    #[cfg(feature = "depth")]
    Depth,
}

/// What a file does not say of itself, for the kinds that need it, and what becomes of its points.
///
/// ```
/// use pointmill_format::OpenOptions;
///
/// let options = OpenOptions::default().columns(["x", "y", "z", "-", "i"]).separator(';');
/// assert_eq!(options.separator, Some(';'));
/// ```
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct OpenOptions {
    /// Text: the names of all columns in file order (`text::TextOptions::columns`); `None`: found.
    pub columns: Option<Vec<String>>,
    /// Text: what stands between two fields; `None`: found. A blank means any blanks.
    pub separator: Option<char>,
    /// Text: what stands before the decimals of a number.
    pub decimal: Decimal,
    /// E57: keep `rowIndex` and `columnIndex`, the place of a point in the scanner's grid, as attributes.
    pub keep_row_column: bool,
    /// E57, PTX, folders of depth maps: the scans within a file that are read, each by name or number ([`crate::scans_named`]); `None`: all.
    /// Files of other kinds have no scans within them and are read whole.
    pub scans: Option<Vec<String>>,
    /// Bytes of memory that the description of a file's scans may take while it is opened (the XML section of E57);
    /// `None`: 1 GiB.
    pub description_bytes: Option<u64>,
    /// Octrees (Potree, COPC): the deepest level that is read, 0 for the root; `None`: all. What has no levels is refused
    /// then.
    pub max_level: Option<u8>,
    /// Octrees: levels whose points are closer to each other than this are not read, but for the root; world units. Leaves
    /// hold whatever points remain, at any distance. What has no levels is refused.
    pub min_spacing: Option<f64>,
    /// Depth maps: what their files do not say, filters and normals.
    pub depth: DepthOptions,
    /// What becomes of the points; `None`: they stay where they are.
    pub maps: Option<Arc<dyn ScanMaps>>,
}

impl OpenOptions {
    /// Sets [`Self::columns`].
    #[must_use]
    pub fn columns<N: Into<String>>(mut self, names: impl IntoIterator<Item = N>) -> Self {
        self.columns = Some(names.into_iter().map(Into::into).collect());
        self
    }

    /// Sets [`Self::separator`].
    #[must_use]
    pub fn separator(mut self, separator: char) -> Self {
        self.separator = Some(separator);
        self
    }

    /// Sets [`Self::decimal`].
    #[must_use]
    pub fn decimal(mut self, decimal: Decimal) -> Self {
        self.decimal = decimal;
        self
    }

    /// Sets [`Self::keep_row_column`].
    #[must_use]
    pub fn keep_row_column(mut self, keep: bool) -> Self {
        self.keep_row_column = keep;
        self
    }

    /// Sets [`Self::scans`].
    #[must_use]
    pub fn scans<N: Into<String>>(mut self, choices: impl IntoIterator<Item = N>) -> Self {
        self.scans = Some(choices.into_iter().map(Into::into).collect());
        self
    }

    /// Sets [`Self::description_bytes`].
    #[must_use]
    pub fn description_bytes(mut self, bytes: u64) -> Self {
        self.description_bytes = Some(bytes);
        self
    }

    /// Sets [`Self::max_level`].
    #[must_use]
    pub fn max_level(mut self, level: u8) -> Self {
        self.max_level = Some(level);
        self
    }

    /// Sets [`Self::min_spacing`].
    #[must_use]
    pub fn min_spacing(mut self, spacing: f64) -> Self {
        self.min_spacing = Some(spacing);
        self
    }

    /// Sets [`Self::depth`].
    #[must_use]
    pub fn depth(mut self, depth: DepthOptions) -> Self {
        self.depth = depth;
        self
    }

    /// True if some levels of an octree are chosen.
    pub(crate) const fn has_levels(&self) -> bool {
        self.max_level.is_some() || self.min_spacing.is_some()
    }

    /// Sets [`Self::maps`].
    #[must_use]
    pub fn maps(mut self, maps: impl ScanMaps + 'static) -> Self {
        self.maps = Some(Arc::new(maps));
        self
    }
}

impl ScanKind {
    /// The kinds that this build reads.
    pub const ALL: &[Self] = &[
        #[cfg(feature = "las")]
        Self::Las,
        #[cfg(feature = "e57")]
        Self::E57,
        #[cfg(feature = "ply")]
        Self::Ply,
        #[cfg(feature = "pcd")]
        Self::Pcd,
        #[cfg(feature = "text")]
        Self::Text(crate::scan::text::TextKind::Xyz),
        #[cfg(feature = "text")]
        Self::Text(crate::scan::text::TextKind::Pts),
        #[cfg(feature = "text")]
        Self::Text(crate::scan::text::TextKind::Ptx),
        #[cfg(feature = "text")]
        Self::Text(crate::scan::text::TextKind::Off),
        #[cfg(feature = "text")]
        Self::Text(crate::scan::text::TextKind::Obj),
        #[cfg(feature = "depth")]
        Self::Depth,
    ];

    /// The kind of a file that starts with these bytes (give some kB, or the whole file if it is shorter).
    #[allow(unused_variables)] // a build without readers asks nothing
    #[must_use]
    pub fn of(first_bytes: &[u8]) -> Option<Self> {
        #[cfg(feature = "las")]
        if crate::scan::las::is_las(first_bytes) {
            return Some(Self::Las);
        }
        #[cfg(feature = "e57")]
        if crate::scan::e57::is_e57(first_bytes) {
            return Some(Self::E57);
        }
        #[cfg(feature = "ply")]
        if crate::scan::ply::is_ply(first_bytes) {
            return Some(Self::Ply);
        }
        #[cfg(feature = "pcd")]
        if crate::scan::pcd::is_pcd(first_bytes) {
            return Some(Self::Pcd);
        }
        #[cfg(feature = "depth")]
        if crate::scan::depth::is_depth(first_bytes) {
            return Some(Self::Depth);
        }
        // last: a binary file may hold lines of numbers, too
        #[cfg(feature = "text")]
        if let Some(kind) = crate::scan::text::kind(first_bytes).filter(|_| OtherKind::of(first_bytes).is_none()) {
            return Some(Self::Text(kind));
        }
        None
    }

    /// The kind of the file at `path`, by its content, or of a folder that is one scan (depth maps).
    ///
    /// # Errors
    /// The operating system cannot read it. A pipe or another folder is of no kind and is not read.
    pub fn of_file(path: impl AsRef<Path>) -> Result<Option<Self>, ReadError> {
        #[cfg(feature = "depth")]
        if crate::scan::depth::is_sequence(path.as_ref()) {
            return Ok(Some(Self::Depth));
        }
        Ok(Self::of(&first_bytes(path.as_ref())?))
    }

    /// The usual name: "LAS", "E57", "PTX" ….
    pub const fn name(self) -> &'static str {
        match self {
            #[cfg(feature = "las")]
            Self::Las => "LAS",
            #[cfg(feature = "e57")]
            Self::E57 => "E57",
            #[cfg(feature = "ply")]
            Self::Ply => "PLY",
            #[cfg(feature = "pcd")]
            Self::Pcd => "PCD",
            #[cfg(feature = "text")]
            Self::Text(kind) => match kind {
                crate::scan::text::TextKind::Xyz => "XYZ",
                crate::scan::text::TextKind::Pts => "PTS",
                crate::scan::text::TextKind::Ptx => "PTX",
                crate::scan::text::TextKind::Off => "OFF",
                crate::scan::text::TextKind::Obj => "OBJ",
            },
            #[cfg(feature = "depth")]
            Self::Depth => "depth map",
        }
    }
}

impl fmt::Display for ScanKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ScanKind {
    type Err = UnknownName;

    /// [`Self::name`], in upper or lower case.
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let mut kinds = Self::ALL.iter().copied();
        kinds.find(|k| k.name().eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|k| k.name()).collect();
            UnknownName::new(name, "kind of scan", &known)
        })
    }
}

/// What this build reads, for people: "LAS, LAZ, E57, …".
#[must_use]
pub fn supported_scans() -> String {
    let kinds = [
        (cfg!(feature = "las"), "LAS, LAZ"),
        (cfg!(feature = "e57"), "E57"),
        (cfg!(feature = "ply"), "PLY"),
        (cfg!(feature = "pcd"), "PCD"),
        (cfg!(feature = "text"), "text (XYZ, CSV, PTS, PTX, OFF, OBJ)"),
        (cfg!(feature = "depth"), "depth maps (PNG)"),
    ];
    let read: Vec<&str> = kinds.into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect();
    read.join(", ")
}

/// Opens a scan of any kind that this build reads; the kind is detected from the content, the extension is ignored.
/// [`OpenOptions::maps`] are not applied.
///
/// # Errors
/// A file that is empty, or of no kind that is read here, and those of the reader of its kind.
#[allow(unused_variables)] // some kinds have no options, and a build may have no kinds
pub(crate) fn open_file(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    #[cfg(feature = "depth")]
    if crate::scan::depth::is_sequence(path) {
        return crate::scan::depth::open(path, &options.depth, options.scans.as_deref());
    }
    let first = first_bytes(path)?;
    let kind = match ScanKind::of(&first) {
        Some(kind) => kind,
        // Columns were named for it, by the user or in it: then it is text, if it can be.
        #[cfg(feature = "text")]
        None if (options.columns.is_some() && !first.is_empty() && !first.contains(&0))
            || crate::scan::text::has_titles(&first) =>
        {
            ScanKind::Text(crate::scan::text::TextKind::Xyz)
        }
        None if first.is_empty() && fs::metadata(path).is_ok_and(|m| m.is_file()) => {
            return Err(ReadError::broken(path, 0, Fault::Empty).advise("copy it again, or leave it out"));
        }
        None => return Err(unknown(path, &first, options)),
    };
    match kind {
        #[cfg(feature = "las")]
        ScanKind::Las => crate::scan::las::open(path),
        #[cfg(feature = "e57")]
        ScanKind::E57 => {
            let e57 = crate::scan::e57::E57Options::default()
                .keep_row_column(options.keep_row_column)
                .scans(options.scans.clone());
            let max_xml = options.description_bytes.unwrap_or(e57.max_xml);
            crate::scan::e57::open_with(path, e57.max_xml(max_xml))
        }
        #[cfg(feature = "ply")]
        ScanKind::Ply => crate::scan::ply::open(path),
        #[cfg(feature = "pcd")]
        ScanKind::Pcd => crate::scan::pcd::open(path),
        #[cfg(feature = "text")]
        ScanKind::Text(_) => {
            let choices = options.scans.as_deref();
            let OpenOptions { columns, separator, decimal, .. } = options.clone();
            let scan = crate::scan::text::open(path, &crate::scan::text::TextOptions { columns, separator, decimal })?;
            Ok(super::partial::choose(scan, choices))
        }
        #[cfg(feature = "depth")]
        ScanKind::Depth => crate::scan::depth::open(path, &options.depth, options.scans.as_deref()),
    }
}

/// The extensions of scans that this build reads. They never decide the kind, but show that a file was meant to be a scan.
fn is_ending_of_scans(extension: &str) -> bool {
    let endings: [(bool, &[&str]); 5] = [
        (cfg!(feature = "las"), &["las", "laz"]),
        (cfg!(feature = "e57"), &["e57"]),
        (cfg!(feature = "ply"), &["ply"]),
        (cfg!(feature = "pcd"), &["pcd"]),
        (cfg!(feature = "text"), &["pts", "ptx", "off", "obj", "xyz", "asc", "csv"]),
    ];
    endings.iter().any(|(is_read, names)| *is_read && names.contains(&extension))
}

/// Why a file of no kind is refused: as no scan at all, or as one of which too little is left.
#[allow(unused_variables)] // only depth maps have such options
fn unknown(path: &Path, first: &[u8], options: &OpenOptions) -> ReadError {
    #[cfg(feature = "depth")]
    if let Some(error) = crate::scan::depth::not_depth(path, first).filter(|_| is_camera_given(path, options)) {
        return error;
    }
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let supported = Advice::Supported(supported_scans());
    if let Some(what) = archive(first) {
        return ReadError::unsupported(path, Fault::Archive { what }).advise(Advice::Unpack);
    }
    if let Some(other) = OtherKind::of(first) {
        return ReadError::unsupported(path, Fault::OtherKind(other.to_string())).advise(supported);
    }
    if cfg!(feature = "text") && (first.starts_with(&[0xff, 0xfe]) || first.starts_with(&[0xfe, 0xff])) {
        return ReadError::unsupported(path, "the text is UTF-16").advise("save it as UTF-8");
    }
    match ending.filter(|e| is_ending_of_scans(e)) {
        _ if first.is_empty() => ReadError::unsupported(path, "not a file that can be read").advise(supported),
        Some(ending) => ReadError::broken(path, 0, Fault::UnknownFormat { extension: Some(ending) })
            .advise(Advice::CopyOrSupported(supported_scans())),
        None if cfg!(feature = "text") && starts_with_number(first) => {
            ReadError::broken(path, 0, Fault::Row("no whole row of three numbers or more".to_owned()))
                .advise(Advice::NameColumns)
        }
        None => ReadError::unsupported(path, Fault::UnknownFormat { extension: None }).advise(supported),
    }
}

/// True if a picture was to be a depth map: a camera was described for it.
#[cfg(feature = "depth")]
fn is_camera_given(path: &Path, options: &OpenOptions) -> bool {
    options.depth.intrinsics.is_some() || crate::scan::depth::is_described(path)
}

/// True if text begins with digits, as the rows of a scan do.
fn starts_with_number(first: &[u8]) -> bool {
    let start = first.trim_ascii_start();
    let start = start.strip_prefix(b"-").unwrap_or(start);
    start.first().is_some_and(u8::is_ascii_digit) && !first.contains(&0)
}

/// The start of a regular file; nothing of anything else: opening a pipe would wait for somebody who writes to it.
fn first_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |e| ReadError::io(path, "reading the first bytes", e);
    let mut first = Vec::with_capacity(SNIFF_BYTES as usize); // or many small reads
    if fs::metadata(path).map_err(io)?.is_file() {
        File::open(path).map_err(io)?.take(SNIFF_BYTES).read_to_end(&mut first).map_err(io)?;
    }
    Ok(first)
}

#[cfg(all(test, feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
mod tests {
    use pointmill_testkit::scans::{SCAN_FOLDERS, scan_fixtures};

    use super::open_file as open_scan;
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn the_kind_of_every_fixture_is_detected_by_content_alone() {
        for fixture in SCAN_FOLDERS.iter().flat_map(|folder| scan_fixtures(folder)) {
            let kind = ScanKind::of_file(&fixture.path).unwrap().map(|k| k.name());
            assert_eq!(kind, Some(fixture.kind), "{}", fixture.name);
        }
    }

    #[test]
    fn what_is_no_scan_is_refused_with_what_is_supported() {
        let error = open_scan(&Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"), &OpenOptions::default());
        let error = error.err().unwrap();
        assert!(matches!(error.kind(), ErrorKind::Unsupported));
        assert!(error.to_string().contains("LAS, LAZ, E57, PLY, PCD, text"), "{error}");
    }

    #[test]
    fn an_archive_is_named_whatever_it_is_called() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.ply.gz", "a.ply", "a.laz", "a"] {
            let path = dir.path().join(name);
            fs::write(&path, b"\x1f\x8b\x08\x08\0\0\0\0\0\x03a.ply\0").unwrap();
            let error = open_scan(&path, &OpenOptions::default()).err().unwrap();
            assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
            assert!(
                error.to_string().ends_with(": this is a gzip file, not a scan; unpack it and name the scans in it")
            );
        }
    }

    #[test]
    fn what_was_to_be_a_scan_and_is_none_is_broken() {
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in [("a.ply", "pl"), ("a.LAZ", "LA"), ("a.csv", "X,Y"), ("a.txt", "12.5 1"), ("a.e57", "")] {
            let path = dir.path().join(name);
            fs::write(&path, bytes).unwrap();
            let error = open_scan(&path, &OpenOptions::default()).err().unwrap();
            assert!(matches!(error.kind(), ErrorKind::Broken) && error.offset() == Some(0), "{error}");
        }
        fs::write(dir.path().join("a.txt"), "1 gallon\n").unwrap();
        let error = open_scan(&dir.path().join("a.txt"), &OpenOptions::default()).err().unwrap();
        assert!(matches!(error.kind(), ErrorKind::Broken), "{error}");
    }
}
