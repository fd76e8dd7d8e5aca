//! A chunk that cannot be divided, because all of its points share one place: its records are put in order on the disk.

use super::chunk::ChunkPlan;
use super::divide::Chunk;
use super::list::List;
use super::raise::Pending;
use crate::cloud::{BigSort, Cloud, Ledger};
use crate::error::ConvertError;
use crate::plan::Duplicates;
use crate::runtime::Runtime;

/// Bytes of records that are written together.
const WRITE_BYTES: usize = 1 << 20;

/// Builds a chunk of points of one place, in `memory_bytes` of memory: a leaf. Also returns whether it is above the
/// capacity: 1 or 0.
pub(super) fn build(
    plan: &ChunkPlan<'_>,
    chunk: &Chunk,
    rt: &Runtime<'_>,
    memory_bytes: u64,
    ledger: &mut Ledger,
) -> Result<(Pending<List>, u64), ConvertError> {
    let Cloud { store, facts, frame, .. } = plan.cloud;
    // points of one place are in order of their bytes
    let mut sort = BigSort::new(rt, frame.stride, memory_bytes, |a: &[u8], b: &[u8]| a.cmp(b));
    sort.fill(&chunk.segments, |segment, records| ledger.load(store, segment, frame.stride, &facts.widening, records))?;
    let file = rt.temp.make()?;
    let is_dropped = plan.cloud.plan.duplicates == Duplicates::Drop;
    let (mut bytes, mut written, mut last) = (Vec::new(), 0u64, Vec::new());
    sort.finish(|record| {
        if is_dropped && last == record {
            ledger.drop_duplicate(record, facts.class.map(|at| record[at]));
            return Ok(());
        }
        if is_dropped {
            last.clear();
            last.extend_from_slice(record);
        }
        bytes.extend_from_slice(record);
        if bytes.len() >= WRITE_BYTES {
            file.write_at(&bytes, written, "writing the points of one place")?;
            written += bytes.len() as u64;
            bytes.clear();
        }
        Ok(())
    })?;
    file.write_at(&bytes, written, "writing the points of one place")?;
    let count = (written + bytes.len() as u64) / frame.stride as u64;
    let root = Pending::leaf(chunk.key, List::of_place(file, count));
    Ok((root, u64::from(count > u64::from(plan.leaf_capacity))))
}
