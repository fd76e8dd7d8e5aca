//! LZF decompression, from any step of a block on whose state is known.
//!
//! A control byte below 32 says that one byte more than its value stand as they are. Any other is a copy: its upper
//! three bits are the length less 2 (7: the next byte adds to it), its lower five and the next byte the distance less 1.
//! So a copy reaches back 8 KiB at most: these bytes and a place in the block are all that a decoder must know.

use crate::ReadError;
use crate::scan::source::Source;

/// The most that `compressed` bytes can become: three bytes copy at most 264.
pub(super) fn most(compressed: u64) -> u64 {
    compressed.saturating_mul(88)
}

/// The longest distance of a copy.
pub(super) const REACH: usize = 8192;
/// The most that a step can become.
const MAX_STEP: usize = 264;
/// The most bytes of a step.
const STEP_BYTES: usize = 33;
/// Least bytes that are read or decompressed at once.
const LEAST: usize = 1024;

/// Why a block cannot be decompressed.
#[derive(Debug)]
pub(super) enum Stop {
    /// What is wrong with it.
    Damaged(String),
    /// It cannot be read.
    Read(ReadError),
}

impl From<ReadError> for Stop {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

/// A block of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Its first byte.
    pub(super) at: u64,
    /// Its bytes.
    pub(super) len: u64,
    /// What it becomes.
    pub(super) decompressed: u64,
}

/// Where a decoder can begin.
#[derive(Debug, Clone, Default)]
pub(super) struct Checkpoint {
    /// The first byte of a step, from the start of the block.
    step: u64,
    /// Decompressed bytes before that step.
    position: u64,
    /// The last of these, as far as copies reach.
    before: Box<[u8]>,
}

impl Checkpoint {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.before.len()
    }
}

/// Decompresses a block from a checkpoint on.
pub(super) struct Decoder<'a> {
    source: &'a Source,
    block: Block,
    /// Compressed bytes, `input_at` the place of the first in the block, `next` the first that is not used.
    input: Vec<u8>,
    input_at: u64,
    next: usize,
    /// Decompressed bytes, `filled` of them; those before `given` were handed out and are there for copies.
    output: Vec<u8>,
    given: usize,
    filled: usize,
    /// Decompressed bytes before `filled`, from the start of the block.
    position: u64,
    /// Bytes that are read or decompressed at once.
    size: usize,
}

impl<'a> Decoder<'a> {
    /// A decoder that reads and decompresses `size` bytes at once, or somewhat more.
    pub(super) fn new(source: &'a Source, block: Block, from: &Checkpoint, size: usize) -> Self {
        let size = size.max(LEAST);
        let mut output = vec![0; REACH + size + MAX_STEP];
        let filled = from.before.len().min(REACH);
        output[..filled].copy_from_slice(&from.before[..filled]);
        let Checkpoint { step: input_at, position, .. } = *from;
        let input = Vec::with_capacity(size + STEP_BYTES);
        Self { source, block, input, input_at, next: 0, output, given: filled, filled, position, size }
    }

    /// Bytes of memory that one takes.
    pub(super) fn bytes(size: usize) -> usize {
        size_of::<Self>() + REACH + MAX_STEP + 2 * size.max(LEAST) + STEP_BYTES
    }

    /// Passes over decompressed bytes, up to `position` from the start of the block.
    pub(super) fn skip_to(&mut self, position: u64) -> Result<(), Stop> {
        let mut left = position.saturating_sub(self.position - (self.filled - self.given) as u64);
        while left > 0 {
            let given = self.decompressed()?.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            self.given += given;
            left -= given as u64;
        }
        Ok(())
    }

    /// Fills `out` with the next decompressed bytes.
    pub(super) fn fill(&mut self, mut out: &mut [u8]) -> Result<(), Stop> {
        while !out.is_empty() {
            let there = self.decompressed()?;
            let (now, later) = out.split_at_mut(there.len().min(out.len()));
            now.copy_from_slice(&there[..now.len()]);
            self.given += now.len();
            out = later;
        }
        Ok(())
    }

    /// Bytes that were not handed out yet: at least one.
    fn decompressed(&mut self) -> Result<&[u8], Stop> {
        if self.given == self.filled {
            self.make_room();
            while self.filled + MAX_STEP <= self.output.len() && self.step(u64::MAX)? == Step::Done {}
            if self.given == self.filled {
                return Err(self.too_short());
            }
        }
        Ok(&self.output[self.given..self.filled])
    }

    /// Decompresses everything up to the end, and checks that the block becomes what it says. The checkpoints of
    /// `places`, decompressed positions that rise, are added to `found`.
    pub(super) fn checkpoints(mut self, places: &[u64], found: &mut Vec<Checkpoint>) -> Result<(), Stop> {
        let mut places = places.iter();
        let mut next = places.next();
        loop {
            if self.filled + MAX_STEP > self.output.len() {
                self.given = self.filled;
                self.make_room();
            }
            match self.step(next.copied().unwrap_or(u64::MAX))? {
                Step::Done => {}
                Step::Crosses => {
                    found.push(self.checkpoint());
                    next = places.next();
                }
                Step::End => break,
            }
        }
        if self.position < self.block.decompressed { Err(self.too_short()) } else { Ok(()) }
    }

    /// The state before the next step.
    fn checkpoint(&self) -> Checkpoint {
        let before = self.output[self.filled.saturating_sub(REACH)..self.filled].into();
        Checkpoint { step: self.input_at + self.next as u64, position: self.position, before }
    }

    /// Forgets what was handed out and is beyond the reach of copies.
    fn make_room(&mut self) {
        let gone = self.given.saturating_sub(REACH);
        self.output.copy_within(gone..self.filled, 0);
        self.given -= gone;
        self.filled -= gone;
    }

    /// Makes a step, but for one that would go beyond the decompressed position `border`.
    #[inline(always)]
    fn step(&mut self, border: u64) -> Result<Step, Stop> {
        if self.input.len() - self.next < STEP_BYTES {
            self.refill()?;
        }
        let bytes = &self.input[self.next..];
        let Some((&control, rest)) = bytes.split_first() else { return Ok(Step::End) };
        let control = usize::from(control);
        let (count, distance, used) = if control < 32 {
            (control + 1, 0, control + 2)
        } else {
            let long = usize::from(control >> 5 == 7);
            let more = if long == 1 { usize::from(*rest.first().ok_or_else(|| self.cut(1))?) } else { 0 };
            let low = usize::from(*rest.get(long).ok_or_else(|| self.cut(1 + long))?);
            ((control >> 5) + more + 2, ((control & 31) << 8 | low) + 1, 2 + long)
        };
        let position = self.position + count as u64;
        if position > border {
            return Ok(Step::Crosses);
        }
        if distance == 0 {
            let literal = rest.get(..count).ok_or_else(|| self.cut(1))?;
            self.output[self.filled..self.filled + count].copy_from_slice(literal);
        } else {
            let start = self.filled.checked_sub(distance).ok_or_else(|| self.before_start(used))?;
            if distance >= count {
                self.output.copy_within(start..start + count, self.filled);
            } else {
                // what is copied may be written by the copy itself
                let out = &mut self.output[..self.filled + count];
                (start..start + count).for_each(|i| out[i + distance] = out[i]);
            }
        }
        self.next += used;
        self.filled += count;
        self.position = position;
        if position > self.block.decompressed {
            return Err(self.too_long());
        }
        Ok(Step::Done)
    }

    /// Reads more of the block.
    #[cold]
    fn refill(&mut self) -> Result<(), Stop> {
        let there = self.input_at + self.input.len() as u64;
        let left = self.block.len - there.min(self.block.len);
        if left == 0 {
            return Ok(());
        }
        self.input.drain(..self.next);
        self.input_at += self.next as u64;
        self.next = 0;
        let kept = self.input.len();
        self.input.resize(kept + left.min(self.size as u64) as usize, 0);
        Ok(self.source.read_at(self.block.at + there, &mut self.input[kept..])?)
    }

    /// The place of a byte of the step, from the start of the block.
    fn place(&self, of_step: usize) -> u64 {
        self.input_at + (self.next + of_step) as u64
    }

    #[cold]
    fn cut(&self, of_step: usize) -> Stop {
        Stop::Damaged(format!("the compressed block ends within a step (byte {} of it)", self.place(of_step)))
    }

    #[cold]
    fn before_start(&self, of_step: usize) -> Stop {
        Stop::Damaged(format!("the compressed block copies from before its start (byte {} of it)", self.place(of_step)))
    }

    #[cold]
    fn too_long(&self) -> Stop {
        let len = self.block.decompressed;
        Stop::Damaged(format!("the compressed block becomes more than the {len} bytes that it claims"))
    }

    #[cold]
    fn too_short(&self) -> Stop {
        let (position, len) = (self.position, self.block.decompressed);
        Stop::Damaged(format!("the compressed block becomes {position} bytes, not {len}"))
    }
}

/// What came of a step.
#[derive(Debug, PartialEq, Eq)]
enum Step {
    Done,
    /// It was not made: it goes beyond the border.
    Crosses,
    /// There is none.
    End,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(compressed: &[u8], decompressed: usize) -> (tempfile::NamedTempFile, Block) {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), [b"before".as_slice(), compressed].concat()).unwrap();
        let block = Block { at: 6, len: compressed.len() as u64, decompressed: decompressed as u64 };
        (file, block)
    }

    fn text(stop: Stop) -> String {
        let Stop::Damaged(what) = stop else { panic!("{stop:?}") };
        what
    }

    fn run(bytes: &[u8], len: usize) -> Result<Vec<u8>, String> {
        let (file, block) = block(bytes, len);
        let source = Source::open(file.path()).unwrap();
        let new = || Decoder::new(&source, block, &Checkpoint::default(), 0);
        new().checkpoints(&[], &mut Vec::new()).map_err(text)?;
        let mut out = vec![0; len];
        new().fill(&mut out).map_err(text)?;
        Ok(out)
    }

    #[test]
    fn literals_near_copies_and_long_copies_are_undone() {
        assert_eq!(run(&[2, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        // one literal, then 3 bytes from 1 back
        assert_eq!(run(&[0, b'a', 0x20, 0], 4).unwrap(), b"aaaa");
        // 7 + 255 + 2 bytes from 2 back
        let long = run(&[1, b'a', b'b', 0xe0, 255, 1], 266).unwrap();
        assert_eq!((long.len(), &long[260..]), (266, b"ababab".as_slice()));
    }

    #[test]
    fn damage_is_told_with_its_byte() {
        assert!(run(&[5, b'a'], 6).unwrap_err().contains("ends within a step (byte 1 of it)"));
        assert!(run(&[0, b'a', 0x20, 9], 4).unwrap_err().contains("before its start (byte 4 of it)"));
        assert!(run(&[2, 1, 2, 3], 2).unwrap_err().contains("more than the 2 bytes"));
        assert!(run(&[2, 1, 2, 3], 4).unwrap_err().contains("becomes 3 bytes, not 4"));
        assert!(run(&[0xe0], 4).unwrap_err().contains("(byte 1 of it)"));
        assert!(run(&[0xe0, 1], 4).unwrap_err().contains("(byte 2 of it)"));
        assert!(run(&[0x20], 4).unwrap_err().contains("(byte 1 of it)"));
    }

    /// A block of literals and copies of all lengths and distances, and what it becomes.
    fn random_block(steps: usize) -> (Vec<u8>, Vec<u8>) {
        let mut seed = 7u32;
        let mut random = |below: usize| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as usize % below
        };
        let (mut block, mut out) = (Vec::new(), Vec::<u8>::new());
        for _ in 0..steps {
            if out.is_empty() || random(3) == 0 {
                let len = random(32) + 1;
                block.push(len as u8 - 1);
                let literal: Vec<u8> = (0..len).map(|_| random(256) as u8).collect();
                block.extend(&literal);
                out.extend(&literal);
                continue;
            }
            let (count, distance) = (random(262) + 3, random(out.len().min(REACH)) + 1);
            let (high, low) = (((distance - 1) >> 8) as u8, (distance - 1) as u8);
            match count - 2 {
                short @ ..7 => block.push((short as u8) << 5 | high),
                long => block.extend([0xe0 | high, (long - 7) as u8]),
            }
            block.push(low);
            (0..count).for_each(|_| out.push(out[out.len() - distance]));
        }
        (block, out)
    }

    #[test]
    fn every_checkpoint_goes_on_where_the_block_is() {
        let (compressed, whole) = random_block(5000);
        let (file, block) = block(&compressed, whole.len());
        let source = Source::open(file.path()).unwrap();
        let places: Vec<u64> = (0..whole.len() as u64).step_by(9973).collect();
        let mut found = Vec::new();
        Decoder::new(&source, block, &Checkpoint::default(), 0).checkpoints(&places, &mut found).unwrap();
        assert_eq!(found.len(), places.len());
        for (place, checkpoint) in places.iter().zip(&found) {
            assert!(checkpoint.before.len() <= REACH && checkpoint.position <= *place);
            for size in [0, 5000] {
                let mut decoder = Decoder::new(&source, block, checkpoint, size);
                decoder.skip_to(*place).unwrap();
                let mut out = vec![0; 30_000.min(whole.len() - *place as usize)];
                let (some, rest) = out.split_at_mut(7);
                decoder.fill(some).unwrap();
                decoder.fill(rest).unwrap();
                assert!(out == whole[*place as usize..][..out.len()], "from {place}");
            }
        }
    }
}
