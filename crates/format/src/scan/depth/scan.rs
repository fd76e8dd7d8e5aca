//! An open depth map, or a folder of them: pieces are frames.

use super::frame::{Frame, Pixels, changed};
use crate::scan::decode::{batch_bytes, batch_points, fitting_batch, point_bytes, resize};
use crate::scan::quantities::NORMALS;
use crate::{
    Column, DepthOptions, Fault, Piece, PointBatch, Positions, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted,
};

/// What the decoder of a picture holds beside its pixels.
const DECODER_BYTES: u64 = 1 << 20;

/// Open depth maps.
pub(super) struct DepthScan {
    pub(super) info: ScanInfo,
    pub(super) frames: Vec<Frame>,
    pub(super) pieces: Vec<Piece>,
    /// Of each piece the index of its frame: those without points have none.
    pub(super) piece_frames: Vec<usize>,
    pub(super) options: DepthOptions,
}

impl Scan for DepthScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let pixels = self.frames.iter().map(|frame| frame.pixel_bytes(&self.options.filters)).max().unwrap_or(0);
        let points = self.pieces.iter().map(|piece| piece.points).max().unwrap_or(0).min(self.most() as u64);
        pixels + DECODER_BYTES + batch_bytes(&self.info.attributes, false, wanted, points)
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let frame = self.piece_frames.get(piece).and_then(|frame| self.frames.get(*frame));
        let (Some(piece), Some(frame)) = (self.pieces.get(piece), frame) else {
            let fault = Fault::NoSuchPiece { piece, pieces: self.pieces.len() };
            return Err(ReadError::unsupported(&self.info.path, fault));
        };
        let with_colours = self.column("rgb").is_some_and(|column| wanted.is_wanted(column));
        let rule = frame.rule(&self.options);
        let pixels = frame.pixels(&rule, &self.options.filters, with_colours, &mut scratch.decoded)?;
        let batch = fitting_batch(&mut scratch.batch, &self.info.attributes, false);
        let places = self.places(wanted);
        let mut first = piece.first_point;
        let mut points = pixels.points().peekable();
        let mut left = piece.points;
        while left > 0 {
            let count = left.min(self.most() as u64) as usize;
            self.prepare(batch, first, count, wanted);
            for row in 0..count {
                let point = points.next().ok_or_else(|| changed(&frame.depth))?;
                places.fill(frame, &pixels, point, row, batch);
            }
            if sink(batch).is_break() {
                return Ok(());
            }
            (first, left) = (first + count as u64, left - count as u64);
        }
        if points.peek().is_some() { Err(changed(&frame.depth)) } else { Ok(()) }
    }
}

/// A pixel that is a point: its column and row, and its depth.
type Point = ([usize; 2], f64);

impl Pixels {
    /// The pixels with a depth, row by row.
    fn points(&self) -> impl Iterator<Item = Point> {
        let grid = &self.grid;
        let place = |i: usize| [i % grid.width, i / grid.width];
        grid.depths.iter().enumerate().filter(|(_, depth)| **depth > 0.0).map(move |(i, depth)| (place(i), *depth))
    }
}

impl DepthScan {
    /// Points of a full batch.
    fn most(&self) -> usize {
        batch_points(point_bytes(&self.info.attributes, false))
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.info.attribute(name).map(|(column, _)| column)
    }

    fn places(&self, wanted: &Wanted) -> Places {
        let wanted = |name: &str| self.column(name).filter(|column| wanted.is_wanted(*column));
        Places { rgb: wanted("rgb"), normals: NORMALS.map(wanted), source: wanted("point source id") }
    }

    /// Gives the batch room for `count` points of the wanted columns.
    fn prepare(&self, batch: &mut PointBatch, first_point: u64, count: usize, wanted: &Wanted) {
        batch.first_point = first_point;
        if let Positions::World(axes) = &mut batch.positions {
            axes.iter_mut().for_each(|axis| resize(axis, count));
        }
        for (i, (column, attribute)) in batch.columns.iter_mut().zip(self.info.attributes.iter()).enumerate() {
            let len = if wanted.is_wanted(i) { count * attribute.elements } else { 0 };
            match column {
                Column::UInt16(values) => resize(values, len),
                Column::Float32(values) => resize(values, len),
                other => other.clear(), // there are no others
            }
        }
    }
}

/// The columns that are filled.
struct Places {
    rgb: Option<usize>,
    normals: [Option<usize>; 3],
    source: Option<usize>,
}

impl Places {
    fn fill(&self, frame: &Frame, pixels: &Pixels, (pixel, depth): Point, row: usize, batch: &mut PointBatch) {
        if let Positions::World(axes) = &mut batch.positions {
            let world = frame.world(pixel, depth);
            for (axis, value) in axes.iter_mut().zip(world) {
                axis[row] = value;
            }
        }
        if let (Some(Column::UInt16(values)), Some(colours)) = (column(self.rgb, batch), &pixels.colours) {
            values[row * 3..][..3].copy_from_slice(&colours.at(pixel[1] * pixels.grid.width + pixel[0]));
        } else if let Some(Column::UInt16(values)) = column(self.rgb, batch) {
            values[row * 3..][..3].fill(0);
        }
        if self.normals.iter().any(Option::is_some) {
            let normal = frame.normal(&pixels.grid, pixel);
            for (place, value) in self.normals.iter().zip(normal) {
                if let Some(Column::Float32(values)) = column(*place, batch) {
                    values[row] = value;
                }
            }
        }
        if let Some(Column::UInt16(values)) = column(self.source, batch) {
            values[row] = u16::try_from(frame.index).unwrap_or(u16::MAX);
        }
    }
}

fn column(place: Option<usize>, batch: &mut PointBatch) -> Option<&mut Column> {
    batch.columns.get_mut(place?)
}
