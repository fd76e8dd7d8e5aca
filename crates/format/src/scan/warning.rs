//! What disagrees in a scan without stopping its reader, as data.

use std::fmt;

use super::dataset_note::DatasetNote;
use crate::error::one_line;

/// Scans that are named in a line; of more, the number is given.
const MAX_NAMED: usize = 5;

/// A disagreement that did not stop the reader. Prints as one line.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs)] // the names and the lines say what the values are
pub enum ScanWarning {
    /// Fewer points are there than the header declares.
    PointsMissing { declared: u64, found: u64, counted: Counted },
    /// More points are there than the header declares, and are not read.
    PointsIgnored { declared: u64, found: u64 },
    /// More points are there than the header declares, and are read.
    PointsUndeclared { declared: u64, found: u64 },
    /// Bytes follow the points that the header declares.
    BytesIgnored { declared: u64, bytes: u64 },
    /// The header declares more points than the bytes can hold.
    PointsImpossible { declared: u64, bytes: u64 },
    /// The header declares another size of the file, or of itself.
    FileSize { declared: u64, found: u64 },
    /// The header declares fewer bytes for itself than it has.
    HeaderSize { declared: u64, taken: u64 },
    /// LAS 1.4: the two point counts of the header differ.
    LegacyCount { legacy: u64, count: u64 },
    /// The declared bounds are inverted or not finite.
    Bounds,
    /// LAZ: the chunk table cannot be used. `chunks`: as many were found without it; `None`: points are decoded in
    /// sequence.
    ChunkTable { why: String, chunks: Option<usize> },
    /// LAZ: the chunk table was wrong (`why`) and is mended (`how`); the mended one was proven.
    ChunkTableMended { why: String, how: String },
    /// LAZ: a LASzip record, but points that are not compressed.
    LaszipIgnored,
    /// LAS: a record (`kind`: VLR or EVLR) starts outside its place.
    RecordOutside { kind: &'static str, index: u32, count: u32, at: u64 },
    /// LAS: a record claims more bytes than there are.
    RecordTooLong { kind: &'static str, index: u32, count: u32, user_id: String, record_id: u16, bytes: u64, at: u64 },
    /// LAS: a record is too large to be read.
    RecordIgnored { kind: &'static str, index: u32, user_id: String, record_id: u16, bytes: u64 },
    /// LAS: more records than are read.
    RecordsIgnored { kind: &'static str, count: u32, read: u32 },
    /// LAS: malformed GeoTIFF keys.
    GeoTiffKeys { version: u16, declared: usize, room: usize },
    /// LAS: a GeoTIFF key for a unit whose code is none, or a user-defined one without its size.
    GeoTiffUnit { key: u16, code: u16 },
    /// LAS: a WKT record without text.
    WktEmpty,
    /// LAS: waveform packets are not read.
    Waveforms { point_format: u8 },
    /// LAS: more than one Extra Bytes record, which describe `widths` bytes of a point, of its `extra` ones. Those with
    /// the numbers `taken`, from 1, are joined.
    ExtraBytesRecords { widths: Vec<usize>, taken: Vec<usize>, extra: usize },
    /// LAS: a record of LASzip's compatibility mode that does not fit the points; they are read as they are.
    CompatibilityIgnored { version: u16, point_format: u8 },
    /// LAS: the header declares no points, the record of LASzip's compatibility mode that many.
    CompatibilityCount { count: u64 },
    /// LAS: the Extra Bytes record is not a multiple of its descriptors.
    ExtraBytesLength { bytes: usize, descriptor: usize },
    /// LAS: extra bytes reach beyond the record.
    ExtraBytesOutside { name: String, data_type: u8, record_len: usize },
    /// LAS: extra bytes without a type.
    ExtraBytesUntyped { bytes: usize, at: usize },
    /// LAS: a scale of extra bytes that is 0 or not finite; 1 is taken.
    ExtraBytesScale { name: String, scale: Vec<f64> },
    /// LAS: an offset of extra bytes that is not finite; 0 is taken.
    ExtraBytesOffset { name: String, offset: Vec<f64> },
    /// LAS: bytes at the end of each record that nothing documents.
    ExtraBytesUndocumented { bytes: usize },
    /// PCD: the sensor's viewpoint is not applied.
    ViewpointIgnored { viewpoint: String },
    /// PCD: width times height is not the number of points; `taken`: what fits the data, else the latter.
    GridSize { width: u64, height: u64, points: u64, taken: u64 },
    /// PCD: a line of the header that is not known.
    HeaderLineIgnored { word: String },
    /// PCD: neither SIZE nor TYPE.
    FieldTypesMissing,
    /// PCD: a field of no values.
    FieldEmpty { name: String },
    /// PLY, PCD, text: splats without another colour than that of their spherical harmonics.
    ColourOfHarmonics,
    /// PLY: a version of the format that is read as 1.0.
    PlyVersion { version: String },
    /// No z: it is 0 for every point.
    NoZ,
    /// The unit of its coordinate reference system is `declared`; its coordinates are taken to be in `given`.
    UnitsClash { declared: String, given: String },
    /// A reprojection changes the datum, in this way.
    DatumChange { by: String },
    /// Nothing says what heights are above; `target`, to which they are reprojected, has them above the ellipsoid.
    HeightsAboveNothing { target: String },
    /// Nothing says the unit of heights, and that of x and y has changed to `beside`.
    HeightsWithoutUnit { beside: String },
    /// Points were turned or scaled, but not the shapes of Gaussian splats.
    SplatsUnturned,
    /// A reprojection moved the points, but turned neither normals nor the poses of scans.
    DirectionsProjected,
    /// Text: a column without numbers.
    ColumnIgnored { number: usize, name: String },
    /// Text: the first column numbers or names the rows.
    RowNumbersIgnored,
    /// Text: the first line is numbers, but titles of the columns and no point.
    TitlesOfNumbers { line: String },
    /// Text: a column has the title of one that is a coordinate.
    TitleTwice { number: usize, name: String },
    /// Text: the values of a column are not what its name or its place says: it is an attribute of its own.
    ColumnUnusual { number: usize, name: String },
    /// Text: commas are decimal marks; one of the numbers.
    DecimalComma { example: String },
    /// Text: blanks and commas both separate columns.
    SeparatorsMixed,
    /// E57: what one or more scans of the file share; indices of the scans, from 0. The line has numbers, from 1.
    InScans { scans: Vec<usize>, warning: Box<ScanWarning> },
    /// E57: more warnings of scans than are kept.
    More,
    /// E57: the points of a scan are those of an earlier one.
    PointsShared,
    /// E57: neither limits nor ranges are declared; a sample of the values gives `low` to `high`.
    NoLimits { what: &'static str, low: f64, high: f64 },
    /// E57: a field of text is not read.
    TextField { name: String },
    /// E57: no elevation; it is taken as 0.
    NoElevation,
    /// E57: a colour without red, green or blue is not read.
    ColourIncomplete,
    /// E57: the rotation is no quaternion (`ignored`) or none of length 1 (`normalised`).
    Rotation { normalised: bool },
    /// E57: too many scans for numbers of 16 bits.
    SourceIdsShared { scans: usize },
    /// E57: the coordinate metadata is no WKT; its start.
    CrsUnknown { start: String },
    /// E57: images are not points; they are not read.
    Images { count: usize },
    /// E57: the description of an image cannot be understood; numbers from 1.
    ImageUnknown { number: usize, why: String },
    /// E57: the last page of the file is not whole; its checksum is missing, or some of it.
    LastPage { missing: u64 },
    /// E57: the XML section has another length, or starts elsewhere, than the header declares.
    XmlLength { declared: u64, found: u64 },
    /// E57: the XML section is not UTF-8 from that byte of it on.
    XmlEncoding { at: u64 },
    /// E57: the root of the XML has an attribute (a namespace, as a rule) twice.
    XmlRepeated { name: String },
    /// E57: numbers of the XML have decimal commas.
    XmlCommas,
    /// E57: a scan has no element that describes points.
    PointsUndescribed,
    /// E57, PTX: not one of the file's scans was chosen.
    NoneChosen { scans: usize },
    /// E57: the file has no scans.
    NoScans,
    /// Depth maps: frames that cannot be read or have no pose; what is wrong with the first of them.
    FramesUnreadable { frames: usize, of: usize, first: String },
    /// Depth maps: frames in which no pixel has a depth.
    FramesEmpty { frames: usize, of: usize },
    /// Depth maps: frames without a colour picture, whose colours are 0.
    FramesColourless { frames: usize, of: usize },
    /// Depth maps: colour pictures are listed with their times, and no depth map has one near in time.
    ColoursElsewhere { of: usize },
    /// What a dataset, read as a scan, does not say or have.
    Dataset(DatasetNote),
    /// Anything else, as text.
    Other(String),
}

/// What was counted, where points are missing.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Counted {
    /// Records of a fixed length that are there whole.
    Records,
    /// Rows that are there whole.
    Rows,
    /// The points of compressed chunks.
    Chunks,
    /// The points of one scan of several; why the others are missing, if that is known.
    Scan(Option<String>),
}

impl fmt::Display for ScanWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&one_line(self.line()))
    }
}

impl ScanWarning {
    fn line(&self) -> String {
        match self {
            Self::PointsMissing { declared, found, counted } => counted.line(*declared, *found),
            Self::PointsIgnored { declared, found } => {
                format!("the chunks hold {found} points; the {declared} that the header declares are read")
            }
            Self::PointsUndeclared { declared, found } => {
                format!("the header declares {declared} points; all {found} that are there are read")
            }
            Self::BytesIgnored { declared: 0, bytes } => {
                format!("the header declares no points; the {bytes} bytes behind it are not read")
            }
            Self::BytesIgnored { declared, bytes } => {
                format!("the header declares {declared} points; the {bytes} bytes that follow them are not read")
            }
            Self::PointsImpossible { declared, bytes } => {
                format!("the header declares {declared} points, more than {bytes} bytes can hold")
            }
            Self::FileSize { declared, found } => format!("the header declares {declared} bytes, the file has {found}"),
            Self::HeaderSize { declared, taken } => {
                format!("the header says it has {declared} bytes; {taken} are taken")
            }
            Self::LegacyCount { legacy, count: 0 } => {
                format!("the 64-bit point count is 0; the legacy count {legacy} is taken")
            }
            Self::LegacyCount { legacy, count } => {
                format!("the legacy point count is {legacy}, the 64-bit one {count}; the latter is taken")
            }
            Self::Bounds => "the header's bounds are inverted or not finite; they are not used".to_owned(),
            Self::NoZ => "there is no z; it is 0 for every point".to_owned(),
            Self::UnitsClash { declared, given } => {
                format!(
                    "its coordinate reference system is in {declared}; the coordinates are taken as {given} and scaled"
                )
            }
            Self::DatumChange { by } => format!("the datum is changed by {by}"),
            Self::HeightsAboveNothing { target } => {
                format!(
                    "nothing says what its heights are above; {target} has them above the ellipsoid, and so they are taken"
                )
            }
            Self::HeightsWithoutUnit { beside } => {
                format!("nothing says the unit of its heights; they are left as they are, beside x and y in {beside}")
            }
            Self::SplatsUnturned => {
                "the shapes of its splats (rot_*, scale_*, f_rest_*) are as in the file; only their places are moved"
                    .to_owned()
            }
            Self::DirectionsProjected => {
                "normals and poses are not turned by the reprojection; they keep the directions of the scan's own axes"
                    .to_owned()
            }
            Self::ColumnIgnored { number, name } => {
                format!("column {number} ({name}) holds no numbers; it is omitted")
            }
            Self::RowNumbersIgnored => {
                "column 1 numbers or names the rows; it is omitted, unless all columns are named".to_owned()
            }
            Self::TitlesOfNumbers { line } => format!("the first line ({line}) has titles of columns, no point"),
            Self::TitleTwice { number, name } => {
                format!("column {number} ({name}) is called like a coordinate; it is an attribute")
            }
            Self::ColumnUnusual { number, name } => {
                format!("column {number} ({name}) holds values that are none of that kind; it is an attribute")
            }
            Self::DecimalComma { example } => format!("commas are decimal marks, as in {example}"),
            Self::SeparatorsMixed => "blanks and commas both separate columns".to_owned(),
            Self::ViewpointIgnored { viewpoint } => format!("the sensor's viewpoint ({viewpoint}) is not applied"),
            Self::GridSize { width, height, points, taken } => {
                format!("WIDTH {width} times HEIGHT {height} is not POINTS {points}; {taken} are taken")
            }
            Self::HeaderLineIgnored { word } => format!("the header line {word:?} is not known; it is not read"),
            Self::FieldTypesMissing => "the header has no SIZE and TYPE; all fields are taken as float32".to_owned(),
            Self::FieldEmpty { name } => format!("the field {name} has COUNT 0: it holds no values"),
            Self::ColourOfHarmonics => {
                "there is no rgb; it is made from the splats' harmonics: 0.5 + 0.28209479 · f_dc, \
                                        cut to 0–1, as 0–255 (f_dc_0 to f_dc_2 are kept)"
                    .to_owned()
            }
            Self::PlyVersion { version } => format!("the format version {version:?} is read as 1.0"),
            Self::FramesUnreadable { frames, of, first } => {
                format!("{frames} of {of} depth maps cannot be read, the first: {first}")
            }
            Self::FramesEmpty { frames, of } => format!("{frames} of {of} depth maps have no depth"),
            Self::FramesColourless { frames, of } => {
                format!("{frames} of {of} depth maps have no colour picture; their colours are 0")
            }
            Self::ColoursElsewhere { of } => {
                format!(
                    "none of the {of} depth maps has a picture near in time in the list of colours; there are no colours"
                )
            }
            Self::Dataset(note) => note.to_string(),
            Self::Other(text) => text.clone(),
            las_or_e57 => las_or_e57.las_line().unwrap_or_else(|| las_or_e57.e57_line()),
        }
    }

    fn las_line(&self) -> Option<String> {
        Some(match self {
            Self::ChunkTable { why, chunks: Some(chunks) } => {
                format!("the chunk table is unusable ({why}); {chunks} chunks were found without it")
            }
            Self::ChunkTable { why, chunks: None } => {
                format!("the chunk table is unusable ({why}); the points are decoded one after the other")
            }
            Self::ChunkTableMended { why, how } => {
                format!(
                    "the chunk table is wrong ({why}): {how}; mended, and proven by decoding a sample of the chunks"
                )
            }
            Self::LaszipIgnored => {
                "there is a LASzip record, but the points are not marked as compressed; it is ignored".to_owned()
            }
            Self::RecordOutside { kind, index, count, at } => {
                format!("{kind} {index} of {count} would lie outside its place, at byte {at}")
            }
            Self::RecordTooLong { kind, index, count, user_id, record_id, bytes, at } => format!(
                "{kind} {index} of {count} ({user_id} {record_id}) claims {bytes} bytes at byte {at}, more than there are"
            ),
            Self::RecordIgnored { kind, index, user_id, record_id, bytes } => {
                format!("{kind} {index} ({user_id} {record_id}) has {bytes} bytes, too many to be kept; it is not read")
            }
            Self::RecordsIgnored { kind, count, read } => {
                format!("the header declares {count} {kind}s; the first {read} are read")
            }
            Self::GeoTiffKeys { version, declared, room } => {
                format!("the GeoTIFF keys are malformed (version {version}, {declared} keys declared, room for {room})")
            }
            Self::GeoTiffUnit { key, code } => {
                format!("the GeoTIFF key {key} declares the unit {code}, which has no known size")
            }
            Self::WktEmpty => "the WKT of the coordinate reference system is empty".to_owned(),
            Self::Waveforms { point_format } => {
                format!("point format {point_format} carries waveform packets; they are not read, all other values are")
            }
            Self::ExtraBytesRecords { widths, taken, extra } => extra_bytes_records(widths, taken, *extra),
            Self::CompatibilityIgnored { version, point_format } => format!(
                "a record of LASzip's compatibility mode (version {version}) does not fit the points (format \
                 {point_format} and its extra bytes); they are read as they are stored"
            ),
            Self::CompatibilityCount { count } => format!(
                "the header declares no points, the record of LASzip's compatibility mode {count}; these are read"
            ),
            Self::ExtraBytesLength { bytes, descriptor } => {
                format!("the Extra Bytes record has {bytes} bytes, not a multiple of {descriptor}")
            }
            Self::ExtraBytesOutside { name, data_type, record_len } => format!(
                "extra bytes \"{name}\" (type {data_type}) do not fit the record of {record_len} bytes; they and what follows are not read"
            ),
            Self::ExtraBytesUntyped { bytes, at } => {
                format!("{bytes} extra bytes at byte {at} of each record have no type; not read")
            }
            Self::ExtraBytesScale { name, scale } => {
                format!("extra bytes \"{name}\" declare the scale {scale:?}; 1 is taken")
            }
            Self::ExtraBytesOffset { name, offset } => {
                format!("extra bytes \"{name}\" declare the offset {offset:?}; 0 is taken")
            }
            Self::ExtraBytesUndocumented { bytes } => {
                format!("the last {bytes} bytes of each record are not documented; not read")
            }
            _ => return None,
        })
    }

    fn e57_line(&self) -> String {
        let fixed = match self {
            Self::InScans { scans, warning } => return in_scans(scans, warning),
            Self::NoLimits { what, low, high } => {
                return format!(
                    "no limits are declared for its {what}; {low} to {high} are taken, by a sample of the values"
                );
            }
            Self::TextField { name } => return format!("the field {name} holds text; it is not read"),
            Self::SourceIdsShared { scans } => {
                return format!("{scans} scans: from 65,535 on they share a point source id");
            }
            Self::CrsUnknown { start } => {
                return format!("the coordinate metadata is no WKT and is not read: {start:?}");
            }
            Self::Images { count: 1 } => "1 image is in the file; it is not part of its points and not read",
            Self::Images { count } => {
                return format!("{count} images are in the file; they are not part of its points and not read");
            }
            Self::ImageUnknown { number, why } => {
                return format!("the description of image {number} is not understood ({why}); it is ignored");
            }
            Self::LastPage { missing } => {
                return format!(
                    "the last page of the file lacks {missing} of its 1024 bytes, of its checksum or before it; what is \
                     there is read"
                );
            }
            Self::XmlLength { declared, found } => {
                return format!("the header declares {declared} bytes of XML; {found} are found there and read");
            }
            Self::XmlEncoding { at } => {
                return format!("the XML is not UTF-8 from its byte {at} on; it is read as Latin-1");
            }
            Self::XmlRepeated { name } => return format!("the XML declares {name} twice; the first is taken"),
            Self::XmlCommas => "numbers of the XML have decimal commas; they are read as decimal points",
            Self::PointsUndescribed => "no points are described for it",
            Self::NoneChosen { scans: 1 } => "its scan was not chosen; nothing of it is read",
            Self::NoneChosen { scans } => {
                return format!("none of its {scans} scans was chosen; nothing of it is read");
            }
            Self::NoScans => "the file has no scans",
            Self::More => "there is more of this kind",
            Self::PointsShared => "its points are those of an earlier scan; they are read once",
            Self::NoElevation => "its points have no elevation; it is taken as 0",
            Self::ColourIncomplete => "its colour lacks red, green or blue; it is not read",
            Self::Rotation { normalised: true } => "the rotation is no unit quaternion; it is normalised",
            Self::Rotation { normalised: false } => "the rotation is no quaternion; it is ignored",
            _ => "",
        };
        fixed.to_owned()
    }
}

fn extra_bytes_records(widths: &[usize], taken: &[usize], extra: usize) -> String {
    let join = |numbers: &[usize]| numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let (there, numbers) = (widths.len(), join(taken));
    let width: usize = taken.iter().map(|i| widths[i - 1]).sum();
    match taken.len() {
        _ if width != extra => format!(
            "there are {there} Extra Bytes records, of {} bytes per point, which do not add up to its {extra} extra \
             bytes; number {numbers} is taken",
            join(widths)
        ),
        1 => format!(
            "there are {there} Extra Bytes records; number {numbers} describes all {extra} extra bytes of a point"
        ),
        _ => format!(
            "there are {there} Extra Bytes records; joined in order, numbers {numbers} describe all {extra} extra \
             bytes of a point"
        ),
    }
}

fn in_scans(scans: &[usize], warning: &ScanWarning) -> String {
    let named: Vec<_> = scans.iter().take(MAX_NAMED).map(|i| (i + 1).to_string()).collect();
    let more = match scans.len() - named.len() {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let what = match warning {
        ScanWarning::NoZ => "its points have no z; it is taken as 0".to_owned(),
        other => other.line(),
    };
    format!("scan{} {}{more}: {what}", if scans.len() == 1 { "" } else { "s" }, named.join(", "))
}

impl Counted {
    fn line(&self, declared: u64, found: u64) -> String {
        let missing = declared.saturating_sub(found);
        match self {
            Self::Records => {
                format!("the header declares {declared} points, {found} whole records are there: {missing} are missing")
            }
            Self::Rows => {
                format!("the header declares {declared} points, {found} whole ones are there: {missing} are missing")
            }
            Self::Chunks => {
                format!("the header declares {declared} points, the chunks hold {found}: {missing} are missing")
            }
            Self::Scan(why) => {
                let why = why.as_ref().map_or_else(String::new, |why| format!(" ({why})"));
                format!("{declared} points are declared, {found} are there{why}")
            }
        }
    }
}
