//! LAS and LAZ.

use pointmill_format::scan::las::write::{ChunkEncoder, CrsRecords, FieldPlace, Heading, RecordLayout, Tally};
use pointmill_format::{Changes, Lattice, WriteError};

use super::encoder::{Encoder, Place};
use super::rows::Block;
use crate::error::{ConvertError, Unsupported};
use crate::plan::ExportFormat;
use crate::runtime::DiskFile;
use crate::sources::Schema;

/// The point formats, without those of wave packets, which no reader here hands out.
const FORMATS: [u8; 7] = [0, 1, 2, 3, 6, 7, 8];

/// A LAS or LAZ file.
pub(super) struct LasFile {
    heading: Heading,
    /// Of chunks (LAZ).
    chunks: Option<ChunkEncoder>,
}

impl LasFile {
    /// `most_points`: no more will be written.
    pub(super) fn new(
        format: ExportFormat,
        schema: &Schema,
        lattice: Lattice,
        crs: CrsRecords,
        most_points: u64,
    ) -> Result<Self, ConvertError> {
        let failed = |error: WriteError| ConvertError::from(Unsupported::Export { format, what: error.to_string() });
        let layout = RecordLayout::choose(&schema.attributes, &FORMATS).map_err(failed)?;
        let is_compressed = format == ExportFormat::Laz;
        let chunks = is_compressed.then(|| ChunkEncoder::new(&layout)).transpose().map_err(failed)?;
        let mut heading = Heading::new(layout, lattice, most_points);
        (heading.crs, heading.is_compressed) = (crs, is_compressed);
        Ok(Self { heading, chunks })
    }
}

/// True if points of these attributes are of a format that has WKT and nothing else (6 and above, LAS 1.4).
pub(super) fn wants_wkt(schema: &Schema) -> bool {
    RecordLayout::choose(&schema.attributes, &FORMATS).is_ok_and(|layout| layout.point_format() >= 6)
}

/// What only a fault of our own code can bring about.
fn internal(error: &WriteError) -> ConvertError {
    ConvertError::Internal(format!("writing LAS: {error}"))
}

impl Encoder for LasFile {
    fn describe(&self) -> String {
        let name = if self.chunks.is_some() { "LAZ" } else { "LAS" };
        let (major, minor) = self.heading.version();
        format!("{name} {major}.{minor}, point format {}", self.heading.layout.point_format())
    }

    fn places(&self) -> Vec<Place> {
        let name = |place: &FieldPlace| match place {
            FieldPlace::Field => "field",
            FieldPlace::AngleField => "field, in steps of 0.006 degrees",
            _ => "extra bytes",
        };
        let places = self.heading.layout.places().iter().enumerate();
        places.map(|(attribute, place)| Place { attribute, place: name(place).to_owned() }).collect()
    }

    fn start(&self) -> Result<u64, ConvertError> {
        self.heading.points_start().map_err(|e| internal(&e))
    }

    fn encode(
        &self,
        block: &Block,
        schema: &Schema,
        tally: &mut Tally,
        changes: &mut [Changes],
    ) -> Result<Option<Vec<u8>>, ConvertError> {
        let layout = &self.heading.layout;
        let columns: Vec<_> = (0..schema.attributes.len()).map(|i| Some(block.column(schema, i))).collect();
        let mut records = vec![0; block.len() * layout.record_len()];
        layout.put(&block.positions(), &columns, &mut records, changes);
        tally.add(layout, &records);
        match &self.chunks {
            Some(chunks) => chunks.encode(&records).map(Some).map_err(|e| internal(&e)),
            None => Ok(Some(records)),
        }
    }

    fn finish(&self, file: &DiskFile, tally: &Tally, parts: &[(u32, u32)], end: u64) -> Result<u64, ConvertError> {
        let table = self.chunks.as_ref().map(|chunks| chunks.table(parts)).transpose().map_err(|e| internal(&e))?;
        let summary = tally.summary(&self.heading.lattice);
        let ending = self.heading.finish(&summary, end, &table.unwrap_or_default()).map_err(|e| internal(&e))?;
        file.write_at(&ending.head, 0, "writing the header")?;
        file.write_at(&ending.tail, ending.tail_start, "writing the end")?;
        Ok(ending.tail_start + ending.tail.len() as u64)
    }
}
