//! The records of a cell in Morton order.

use std::io;

use crate::cells::{BLOCK, Grid};

/// Bytes that are written at once.
const WRITE_BYTES: usize = 1 << 20;

const DIGIT_BITS: u32 = 9;

/// Sorts cells; keeps its memory from one to the next.
#[derive(Default)]
pub(crate) struct Sorter {
    /// Index of each record, and above it the code if there is room for both.
    keys: Vec<u64>,
    swap: Vec<u64>,
    out: Vec<u8>,
}

impl Sorter {
    /// Hands the records of `blocks` to `write`, in order, about a megabyte at a time.
    pub(crate) fn records_in_order(
        &mut self,
        grid: &Grid,
        blocks: &[&[u8]],
        mut write: impl FnMut(&[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        let len = grid.record_len;
        let record = |i: usize| &blocks[i / BLOCK][i % BLOCK * len..][..len];
        let index_bits = (blocks.len() * BLOCK).next_power_of_two().ilog2();
        let index = |key: &u64| *key as usize & ((1 << index_bits) - 1);
        self.keys.clear();
        for (b, block) in blocks.iter().enumerate() {
            let first = (b * BLOCK) as u64;
            self.keys.extend(first..first + (block.len() / len) as u64);
        }
        if grid.code_bits() + index_bits <= u64::BITS {
            self.keys.iter_mut().for_each(|key| *key |= grid.code(record(index(key))) << index_bits);
            self.sort(index_bits, index_bits + grid.code_bits());
        } else {
            self.keys.sort_by_cached_key(|key| grid.code(record(index(key))));
        }
        for keys in self.keys.chunks((WRITE_BYTES / len).max(1)) {
            self.out.resize(keys.len() * len, 0);
            for (out, key) in self.out.chunks_exact_mut(len).zip(keys) {
                out.copy_from_slice(record(index(key)));
            }
            write(&self.out)?;
        }
        Ok(())
    }

    /// Radix sort by the bits `from..to`, least significant digit first.
    fn sort(&mut self, from: u32, to: u32) {
        self.swap.resize(self.keys.len(), 0);
        for shift in (from..to).step_by(DIGIT_BITS as usize) {
            let digit = |key: u64| (key >> shift) as usize & ((1 << DIGIT_BITS) - 1);
            let mut starts = [0; 1 << DIGIT_BITS];
            self.keys.iter().for_each(|key| starts[digit(*key)] += 1);
            let mut next = 0;
            for start in &mut starts {
                next += std::mem::replace(start, next);
            }
            for key in &self.keys {
                let start = &mut starts[digit(*key)];
                self.swap[*start] = *key;
                *start += 1;
            }
            std::mem::swap(&mut self.keys, &mut self.swap);
        }
    }
}
