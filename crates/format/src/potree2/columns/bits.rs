//! Bits of a Brotli stream, the lowest first.

/// Bytes that are made room for at once.
const ROOM: usize = 1 << 12;

/// Appends bits to bytes; what does not fill a byte waits.
pub(super) struct BitWriter<'a> {
    out: &'a mut Vec<u8>,
    /// Bytes of `out` that are written; behind them is room.
    written: usize,
    /// The bits that wait, from bit 0 on; always fewer than 8 between calls.
    waiting: u64,
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(super) fn new(out: &'a mut Vec<u8>) -> Self {
        let written = out.len();
        Self { out, written, waiting: 0, count: 0 }
    }

    /// Appends the lowest `count` bits of `bits`, at most 56; the others are zero.
    #[inline]
    pub(super) fn write(&mut self, bits: u64, count: u32) {
        debug_assert!(count <= 56 && bits >> count == 0);
        self.waiting |= bits << self.count;
        self.count += count;
        // always eight bytes: a copy of a known length is a single instruction
        if self.out.len() < self.written + 8 {
            self.out.resize(self.written + ROOM, 0);
        }
        self.out[self.written..self.written + 8].copy_from_slice(&self.waiting.to_le_bytes());
        let whole = self.count / 8;
        self.written += whole as usize;
        self.waiting = self.waiting.checked_shr(8 * whole).unwrap_or(0);
        self.count %= 8;
    }

    /// Fills the last byte with zeros and gives the bytes back.
    pub(super) fn finish(mut self) -> &'a mut Vec<u8> {
        self.write(0, (8 - self.count) % 8);
        self.out.truncate(self.written);
        self.out
    }
}
