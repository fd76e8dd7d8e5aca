//! Commands of a Brotli stream: so many bytes as they are, then a copy of earlier ones (RFC 7932, sections 4 and 5).

/// One command. A `copy` of zero (only at the end) copies nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Command {
    /// Bytes inserted as they are.
    pub(super) insert: u32,
    /// Bytes copied after them, at least 2.
    pub(super) copy: u32,
    /// How many bytes back they are.
    pub(super) distance: u32,
}

/// Puts commands together; copies that continue each other become one.
#[derive(Debug, Default)]
pub(super) struct Commands {
    done: Vec<Command>,
    open: Command,
}

impl Commands {
    pub(super) fn clear(&mut self) {
        self.done.clear();
        self.open = Command::default();
    }

    /// The next `count` bytes are inserted.
    #[inline]
    pub(super) fn insert(&mut self, count: u32) {
        if count > 0 {
            self.close();
            self.open.insert += count;
        }
    }

    /// The next `count` bytes, at least 2 or more of the copy before, are those `distance` back.
    #[inline]
    pub(super) fn copy(&mut self, count: u32, distance: u32) {
        if self.open.distance != distance {
            self.close();
        }
        self.open.copy += count;
        self.open.distance = distance;
    }

    /// The distance of the copy that the last byte is of.
    #[inline]
    pub(super) fn continued(&self) -> Option<u32> {
        (self.open.copy > 0).then_some(self.open.distance)
    }

    /// All of them.
    pub(super) fn finish(&mut self) -> &[Command] {
        if self.open != Command::default() {
            self.done.push(self.open);
            self.open = Command::default();
        }
        &self.done
    }

    fn close(&mut self) {
        if self.open.copy > 0 {
            self.done.push(self.open);
            self.open = Command::default();
        }
    }
}

/// A number as a code with extra bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Coded {
    pub(super) code: usize,
    pub(super) extra: u64,
    pub(super) extra_bits: u32,
}

/// The smallest number of each code and its extra bits.
type Ranges = [(u32, u32); 24];

const INSERTS: Ranges = [
    (0, 0),
    (1, 0),
    (2, 0),
    (3, 0),
    (4, 0),
    (5, 0),
    (6, 1),
    (8, 1),
    (10, 2),
    (14, 2),
    (18, 3),
    (26, 3),
    (34, 4),
    (50, 4),
    (66, 5),
    (98, 5),
    (130, 6),
    (194, 7),
    (322, 8),
    (578, 9),
    (1090, 10),
    (2114, 12),
    (6210, 14),
    (22_594, 24),
];

const COPIES: Ranges = [
    (2, 0),
    (3, 0),
    (4, 0),
    (5, 0),
    (6, 0),
    (7, 0),
    (8, 0),
    (9, 0),
    (10, 1),
    (12, 1),
    (14, 2),
    (18, 2),
    (22, 3),
    (30, 3),
    (38, 4),
    (54, 4),
    (70, 5),
    (102, 5),
    (134, 6),
    (198, 7),
    (326, 8),
    (582, 9),
    (1094, 10),
    (2118, 24),
];

fn coded(number: u32, ranges: &Ranges) -> Coded {
    let code = ranges.partition_point(|(from, _)| *from <= number) - 1;
    let (from, extra_bits) = ranges[code];
    Coded { code, extra: u64::from(number - from), extra_bits }
}

#[inline]
pub(super) fn coded_insert(count: u32) -> Coded {
    match count {
        0..6 => Coded { code: count as usize, extra: 0, extra_bits: 0 },
        _ => coded(count, &INSERTS),
    }
}

#[inline]
pub(super) fn coded_copy(count: u32) -> Coded {
    match count.max(2) - 2 {
        code @ 0..8 => Coded { code: code as usize, extra: 0, extra_bits: 0 },
        _ => coded(count, &COPIES),
    }
}

/// The symbol for the codes of an insert and a copy. `same_distance`: the distance is the last one and not stored, where
/// there is a symbol for that.
#[inline]
pub(super) fn command_symbol(insert: usize, copy: usize, same_distance: bool) -> usize {
    const CELLS: [[usize; 3]; 3] = [[128, 192, 384], [256, 320, 512], [448, 576, 640]];
    let cell = match (insert / 8, copy / 8) {
        (0, column @ 0..=1) if same_distance => 64 * column,
        (row, column) => CELLS[row][column],
    };
    cell + 8 * (insert % 8) + copy % 8
}

/// Symbols below this store no distance.
pub(super) const WITH_DISTANCE: usize = 128;

/// Distances used lately, for which there are short codes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recent {
    /// The last one first; 0: not known.
    last: [u32; 4],
}

impl Recent {
    /// Which of them `distance` is, 0 for the last; from now on it is the last.
    #[inline]
    pub(super) fn take(&mut self, distance: u32) -> Option<usize> {
        let at = self.last.iter().position(|known| *known == distance);
        if at != Some(0) {
            self.last = [distance, self.last[0], self.last[1], self.last[2]];
        }
        at
    }
}

/// The code of a distance that is not recent; its lowest `postfix` bits are in the code.
#[inline]
pub(super) fn coded_distance(distance: u32, postfix: u32) -> Coded {
    let back = distance - 1;
    let low = back & ((1 << postfix) - 1);
    let high = (back >> postfix) + 4;
    let extra_bits = high.ilog2() - 1;
    let half = high >> extra_bits & 1;
    let code = 16 + ((2 * (extra_bits - 1) + half) << postfix | low);
    Coded { code: code as usize, extra: u64::from(high & ((1 << extra_bits) - 1)), extra_bits }
}
