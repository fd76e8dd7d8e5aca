//! A scan in memory that breaks one promise at a time: each is noticed, and named.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use pointmill_format::{
    Attribute, AttributeType, Column, Piece, PointBatch, Positions, ReadError, Scan, ScanInfo, ScanWarning, Scratch,
    Sink, Wanted,
};
use pointmill_testkit::reader::{columns_are_independent, keeps_promises, read};

/// What the scan does wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    Gap,
    EmptyPiece,
    PieceOutside,
    ManyWarnings,
    SkippedPoint,
    EmptyBatch,
    LargeBatch,
    MorePoints,
    FewerPoints,
    NoLattice,
    UnequalAxes,
    MissingColumn,
    WrongType,
    ShortColumn,
    UnwantedColumn,
    OtherValuesAgain,
    OtherPositionsAlone,
    OtherColumnAlone,
    StopIsAnError,
    StopIsIgnored,
    NoSuchPiece,
    ErrorOfTwoLines,
    ErrorWithoutByte,
    ErrorWithoutAdvice,
    ReadsTooMuch,
}

struct Fake {
    info: ScanInfo,
    pieces: Vec<Piece>,
    fault: Fault,
    decodes: std::sync::atomic::AtomicUsize,
}

/// Points of a piece, of a batch, and bytes of the file.
const PIECE: u64 = 100;
const BATCH: u64 = 40;
const FILE_BYTES: u64 = 5000;

/// A file that exists.
const THERE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");

fn fake(fault: Fault) -> Fake {
    let attributes = vec![
        Attribute::new("rgb", AttributeType::UInt16, 3),
        Attribute::new("intensity", AttributeType::UInt16, 1),
        Attribute::new("time", AttributeType::Float64, 1),
    ];
    let piece = |i: u64| Piece::new(i * PIECE..(i + 1) * PIECE, i * 1000..(i + 1) * 1000);
    let mut pieces: Vec<Piece> = (0..3).map(piece).collect();
    let mut warnings = vec![ScanWarning::Other("the header is odd".to_owned())];
    match fault {
        Fault::Gap => pieces[1].first_point += 1,
        Fault::EmptyPiece => pieces[2].points = 0,
        Fault::PieceOutside => pieces[2].byte_len = u64::MAX,
        Fault::ManyWarnings => warnings = vec![ScanWarning::NoScans; 1000],
        Fault::LargeBatch => pieces[0].points = 100_000,
        _ => {}
    }
    if fault == Fault::LargeBatch {
        pieces.truncate(1);
    }
    let mut info = ScanInfo::new("fake", "fake", 3 * PIECE);
    info.attributes = attributes.into();
    (info.file_bytes, info.warnings) = (FILE_BYTES, warnings);
    Fake { info, pieces, fault, decodes: 0.into() }
}

impl Fake {
    /// A batch without a fault, except in its columns.
    fn batch(&self, first_point: u64, len: u64, wanted: &Wanted, decode: usize) -> PointBatch {
        let fault = self.fault;
        let again = if fault == Fault::OtherValuesAgain && decode > 3 { 1.0 } else { 0.0 };
        let alone = !wanted.flags().contains(&true) && fault == Fault::OtherPositionsAlone;
        let value = |i: u64| (first_point + i) as f64 + if alone { 0.5 } else { 0.0 };
        let axis = |k: f64| (0..len).map(|i| if i == 7 { f64::NAN } else { k * value(i) }).collect::<Vec<f64>>();
        let mut xyz = [axis(1.0), axis(-1.0), axis(0.25)];
        if fault == Fault::UnequalAxes {
            xyz[1].pop();
        }
        let filled = |i: usize| wanted.is_wanted(i) || fault == Fault::UnwantedColumn;
        let count = |i: usize, elements: u64| if filled(i) { (len * elements) as usize } else { 0 };
        let only_one = wanted.flags().iter().filter(|w| **w).count() == 1;
        let shift = u16::from(fault == Fault::OtherColumnAlone && only_one);
        let times = (0..count(2, 1)).map(|i| value(i as u64) + again).collect();
        let mut columns = vec![
            Column::UInt16(vec![9 + shift; count(0, 3)]),
            Column::UInt16(vec![7; count(1, 1) - usize::from(fault == Fault::ShortColumn && wanted.is_wanted(1))]),
            Column::Float64(times),
        ];
        match fault {
            Fault::MissingColumn => drop(columns.pop()),
            Fault::WrongType => columns[1] = Column::UInt8(vec![7; count(1, 1)]),
            _ => {}
        }
        let positions = match fault {
            Fault::NoLattice => Positions::Quantized([0, 1, 2].map(|_| vec![1; len as usize])),
            _ => Positions::World(xyz),
        };
        let mut batch = PointBatch::new(first_point, positions, Arc::clone(&self.info.attributes));
        batch.columns = columns;
        batch
    }

    fn error(&self) -> Option<ReadError> {
        match self.fault {
            Fault::ErrorOfTwoLines => Some(ReadError::broken("fake", 7, "odd").advise("look at it\nvery closely")),
            // of a file that is there: a missing one has no bytes
            Fault::ErrorWithoutByte => Some(ReadError::broken(THERE, None, "odd").advise("look at it")),
            Fault::ErrorWithoutAdvice => Some(ReadError::broken("fake", 7, "odd")),
            _ => None,
        }
    }
}

impl Scan for Fake {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode_bytes(&self, _: &Wanted) -> u64 {
        u64::MAX
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let decode = self.decodes.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let Some(piece) = self.pieces.get(piece) else {
            let error = ReadError::broken("fake", 0, "no such piece").advise("ask for another");
            return if self.fault == Fault::NoSuchPiece { Ok(()) } else { Err(error) };
        };
        let bytes = if self.fault == Fault::ReadsTooMuch { FILE_BYTES + 1 } else { piece.byte_len };
        scratch.raw.resize(bytes as usize, 0);
        let batch = if self.fault == Fault::LargeBatch { piece.points } else { BATCH };
        let (mut at, mut end) = (piece.first_point, piece.first_point + piece.points);
        match self.fault {
            Fault::MorePoints => end += 1,
            Fault::FewerPoints => end -= 1,
            Fault::EmptyBatch => {
                let _ = sink(&self.batch(at, 0, wanted, decode));
            }
            _ => {}
        }
        while at < end {
            let len = batch.min(end - at);
            let skipped = u64::from(self.fault == Fault::SkippedPoint && at > piece.first_point);
            if sink(&self.batch(at + skipped, len - skipped, wanted, decode)).is_break() {
                match self.fault {
                    Fault::StopIsIgnored => {}
                    Fault::StopIsAnError => return Err(ReadError::broken("fake", 0, "stopped").advise("go on")),
                    _ => return Ok(()),
                }
            }
            at += len;
        }
        self.error().map_or(Ok(()), Err)
    }
}

/// What is said of a scan with that fault.
fn complaint(fault: Fault) -> Option<String> {
    let check = || {
        let scan = fake(fault);
        keeps_promises(&scan, &Wanted::all(scan.info()), u64::MAX);
        keeps_promises(&scan, &Wanted::positions(scan.info()), u64::MAX);
        columns_are_independent(&scan);
    };
    let payload = catch_unwind(AssertUnwindSafe(check)).err()?;
    Some(payload.downcast_ref::<String>().cloned().unwrap_or_else(|| (*payload.downcast::<&str>().unwrap()).to_owned()))
}

#[test]
fn a_scan_that_keeps_its_promises_passes_and_gives_its_points() {
    assert_eq!(complaint(Fault::None), None);
    let scan = fake(Fault::None);
    let cloud = read(&scan, &Wanted::all(scan.info()));
    assert_eq!((cloud.len(), cloud.promised, cloud.errors.len()), (300, 300, 0));
    assert_eq!((cloud.xyz[1][299], cloud.values("time")[42], cloud.values("rgb").len()), (-299.0, 42.0, 900));
    assert!(cloud.warned("odd") && cloud.attributes().starts_with("rgb uint16x3, intensity uint16x1"));
}

#[test]
fn each_broken_promise_is_noticed_and_named() {
    for (fault, words) in [
        (Fault::Gap, "pieces are consecutive"),
        (Fault::EmptyPiece, "piece 2 is empty"),
        (Fault::PieceOutside, "piece 2 ends outside the file"),
        (Fault::ManyWarnings, "1000 warnings"),
        (Fault::SkippedPoint, "batches are consecutive"),
        (Fault::EmptyBatch, "a batch of 0 points"),
        (Fault::LargeBatch, "a batch of 100000 points"),
        (Fault::MorePoints, "more points than piece 0 has"),
        (Fault::FewerPoints, "points are missing in piece 0 without an error"),
        (Fault::NoLattice, "positions are on a lattice, or the scan has none"),
        (Fault::UnequalAxes, "the axes have the same length"),
        (Fault::MissingColumn, "one column for each attribute"),
        (Fault::WrongType, "the type of intensity"),
        (Fault::ShortColumn, "values of intensity, which is wanted"),
        (Fault::UnwantedColumn, "values of rgb, which is not wanted"),
        (Fault::OtherValuesAgain, "differs when decoded again"),
        (Fault::OtherPositionsAlone, "depend on what else is wanted"),
        (Fault::OtherColumnAlone, "rgb differs when it alone is wanted"),
        (Fault::StopIsAnError, "a sink that stops is an error"),
        (Fault::StopIsIgnored, "a sink that stopped is called again"),
        (Fault::NoSuchPiece, "a piece that does not exist is decoded"),
        (Fault::ErrorOfTwoLines, "an error is not one line"),
        (Fault::ErrorWithoutByte, "an error without its byte"),
        (Fault::ErrorWithoutAdvice, "an error without advice"),
        (Fault::ReadsTooMuch, "5001 bytes are read from a file of 5000"),
    ] {
        let complaint = complaint(fault).unwrap_or_else(|| panic!("{fault:?} was not noticed"));
        assert!(complaint.contains(words), "{fault:?}: {complaint}");
    }
}
