//! The inner loops, for `crates/bench` alone: no promise is made about these.

use pointmill_format::{Attribute, Lattice, NodeKey};

use crate::cloud::{
    Checksum, Cube, JobBounds, JobPoint, OrderScratch, Point, RecordFrame, StoredOrigin, TreePoint, order, position,
};
use crate::octree::{NodeEncoder, Sampler, Sampling, Spacing};
use crate::outputs::potree2::{Encoding, OutputLayout, PayloadEncoder};
use crate::runtime::Silent;
use crate::sources::Schema;

/// The records of a chunk, as the converter holds them while it builds the chunk.
pub struct Chunk {
    frame: RecordFrame,
    records: Vec<u8>,
    points: Vec<Point>,
    scratch: OrderScratch,
    encoder: PayloadEncoder<'static>,
}

impl Chunk {
    /// `records`: three `i32` of position, then `attributes`, packed. `None` if there are none.
    pub fn new(records: Vec<u8>, attributes: Vec<Attribute>) -> Option<Self> {
        let schema = Schema::new(attributes);
        let origin = StoredOrigin(JobPoint([0; 3]));
        let mut bounds = JobBounds::EMPTY;
        for record in records.chunks_exact(schema.stride) {
            let p = origin.job(position(record));
            bounds.union(&JobBounds { min: p, max: p });
        }
        let lattice = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let cube = Cube::around(&bounds, &lattice).ok().filter(|_| !bounds.is_empty())?;
        let frame = RecordFrame { stride: schema.stride, cube, origin };
        let kept: Vec<usize> = (0..schema.attributes.len()).collect();
        let encoder = PayloadEncoder::new(OutputLayout::new(&schema, &kept, &frame), Encoding::Default, &Silent);
        Some(Self { frame, records, points: Vec::new(), scratch: OrderScratch::default(), encoder })
    }

    /// Morton order of all records; returns their number.
    pub fn sort(&mut self) -> usize {
        order(&self.records, &self.frame, 0, &mut self.scratch, &mut self.points);
        self.points.len()
    }

    /// Tree coordinates in the order of the last sort.
    pub fn trees(&self) -> Vec<[u32; 3]> {
        self.points.iter().map(|p| p.t.0).collect()
    }

    /// The DEFAULT payload of all records, in the order of the last sort, checksum included; returns its bytes.
    pub fn encode_default(&mut self, out: &mut Vec<u8>) -> usize {
        out.clear();
        let (records, stride) = (&self.records, self.frame.stride);
        let ordered = self.points.iter().map(|p| &records[p.record as usize * stride..][..stride]);
        let encoded = self.encoder.encode(NodeKey::ROOT, ordered, &mut Checksum::default(), out);
        encoded.map_or(0, |()| out.len())
    }
}

/// Chooses from candidates in Morton order, as an inner node of `level` does.
pub struct Sample(Sampler);

impl Sample {
    /// A sampler of that kind.
    pub fn new(sampling: Sampling) -> Self {
        Self(Sampler::new(sampling, Spacing::default()))
    }

    /// The number of candidates that the node takes.
    pub fn choose(&mut self, level: u8, candidates: &[[u32; 3]]) -> usize {
        self.0.begin(NodeKey { level, ..NodeKey::ROOT }, &[]);
        self.0.offer(candidates.iter().copied().map(TreePoint));
        self.0.choose().iter().filter(|taken| **taken).count()
    }
}
