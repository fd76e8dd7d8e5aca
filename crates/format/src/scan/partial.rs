//! A scan of which some parts are read.

use super::chosen::chosen;
use super::decode::{batch_bytes, batch_points, point_bytes};
use super::{Piece, Scan, ScanInfo, Scratch, Sink, Wanted};
use crate::{Fault, ReadError, ScanWarning};

/// Some parts of another scan, as if its file had no others.
struct PartialScan {
    inner: Box<dyn Scan>,
    info: ScanInfo,
    pieces: Vec<Piece>,
    /// Of each piece its index in `inner`.
    inner_pieces: Vec<usize>,
}

/// The parts of a scan that are chosen by name or number; all of it without a choice, or without parts.
pub(super) fn choose(inner: Box<dyn Scan>, choices: Option<&[String]>) -> Box<dyn Scan> {
    let parts = &inner.info().parts;
    if choices.is_none() || parts.is_empty() {
        return inner;
    }
    let names: Vec<&str> = parts.iter().map(|part| part.name.as_str()).collect();
    let is_chosen = chosen(choices, &names);
    let mut info = inner.info().clone();
    let mut is_part_chosen = is_chosen.iter();
    info.parts.retain(|_| is_part_chosen.next().copied().unwrap_or(false));
    let (mut pieces, mut inner_pieces, mut next) = (Vec::new(), Vec::new(), 0);
    for part in &mut info.parts {
        let start = next;
        let of_part = |(_, piece): &(usize, &Piece)| part.range.contains(&piece.first_point);
        for (i, piece) in inner.pieces().iter().enumerate().filter(of_part) {
            pieces.push(Piece { first_point: next, ..piece.clone() });
            inner_pieces.push(i);
            next += piece.points;
        }
        part.range = start..next;
    }
    info.points_declared = info.parts.iter().fold(0, |sum: u64, part| sum.saturating_add(part.points));
    info.bounds_declared = None;
    if info.parts.is_empty() {
        info.warnings.push(ScanWarning::NoneChosen { scans: is_chosen.len() });
    }
    info.format = format!("{}, {} read", info.format, info.parts.len());
    Box::new(PartialScan { inner, info, pieces, inner_pieces })
}

impl Scan for PartialScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let points = self.pieces.iter().map(|piece| piece.points).max().unwrap_or(0);
        let points = points.min(batch_points(point_bytes(&self.info.attributes, false)) as u64);
        self.inner.decode_bytes(wanted) + batch_bytes(&self.info.attributes, false, wanted, points)
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let (Some(outer), Some(inner)) = (self.pieces.get(piece), self.inner_pieces.get(piece)) else {
            let fault = Fault::NoSuchPiece { piece, pieces: self.pieces.len() };
            return Err(ReadError::unsupported(&self.info.path, fault));
        };
        let before = self.inner.pieces().get(*inner).map_or(0, |piece| piece.first_point);
        self.inner.decode(*inner, wanted, scratch, &mut |batch| {
            // lines of numbers are slow to read: a copy does not show
            let mut batch = batch.clone();
            batch.first_point = batch.first_point - before + outer.first_point;
            sink(&batch)
        })
    }
}
