//! Records of both sides in one shape, and their hashes.

use pointmill_format::{Attribute, AttributeType, Column, with_column};

/// Points handled at once: small enough that all columns of a block stay in the processor's cache.
pub(crate) const BLOCK_POINTS: usize = 4096;

/// Up to [`BLOCK_POINTS`] records: integer positions on the dataset's lattice, and the bits of every attribute.
#[derive(Debug, Default)]
pub(crate) struct Block {
    /// x, y, z, rounded to the nearest lattice point; or what `Rules::stored` makes of them.
    pub(crate) positions: [Vec<i64>; 3],
    /// The same, rounded towards zero; filled on request.
    pub(crate) truncated: [Vec<i64>; 3],
    /// For each attribute of the dataset but the position: the bits of its elements, point by point.
    pub(crate) words: Vec<Vec<u64>>,
    /// What the lattice takes away of the position; filled where equal records count once.
    pub(crate) residues: Vec<u64>,
    /// Which records take part.
    pub(crate) keep: Vec<bool>,
    /// Of the sources: what the lattice and the format do to each record's position.
    pub(crate) moved: Moved,
    /// Hash states of what was mixed in so far.
    states: Vec<[u64; 2]>,
}

/// By how much positions of a block of the sources move, by record.
#[derive(Debug, Default)]
pub(crate) struct Moved {
    /// Index of the block's first point in its file: blocks of a file are added up in this order.
    pub(crate) first: u64,
    /// Positions of the sources.
    pub(crate) world: [Vec<f64>; 3],
    /// Their points on the job lattice, less these.
    pub(crate) lattice: [Vec<f64>; 3],
    /// The integers that the file has do not come back from the job lattice.
    pub(crate) lost: Vec<bool>,
    /// What the job lattice takes away of a position, if points that fall together are counted; else empty.
    pub(crate) marks: Vec<u64>,
    /// Where the dataset's integers are not certain, those of the sources on its lattice; else empty.
    pub(crate) steps: Vec<[i64; 3]>,
}

impl Moved {
    fn clear(&mut self) {
        self.world.iter_mut().chain(&mut self.lattice).for_each(Vec::clear);
        self.lost.clear();
        self.marks.clear();
        self.steps.clear();
    }
}

/// Odd constants with well-spread bits (hexadecimal digits of π and e).
const FACTORS: [u64; 2] = [0x243F_6A88_85A3_08D3 | 1, 0xB7E1_5162_8AED_2A6B | 1];
const SEEDS: [u64; 2] = [0x1319_8A2E_0370_7344, 0xBF71_5880_9CF4_F3C7];

fn fold(x: u64, factor: u64) -> u64 {
    let product = u128::from(x) * u128::from(factor);
    product as u64 ^ (product >> 64) as u64
}

/// Two independent 64-bit multiply-and-fold chains: a changed bit changes each with probability 1 − 2⁻⁶⁴ or so.
/// Not made to withstand someone who builds collisions on purpose.
#[inline]
pub(crate) fn mix([a, b]: [u64; 2], word: u64) -> [u64; 2] {
    [fold(a ^ word, FACTORS[0]) ^ SEEDS[1], fold(b ^ word.rotate_left(29), FACTORS[1]).wrapping_add(SEEDS[0])]
}

/// A part of space, 0–65,535, by a hash of the position: a record of the source and its counterpart in the dataset
/// are in the same one.
pub(crate) fn bucket(position: [i64; 3]) -> usize {
    let [a, _] = position.iter().fold([SEEDS[1], SEEDS[0]], |s, v| mix(s, *v as u64));
    (a >> 48) as usize
}

/// The number of buckets.
pub(crate) const BUCKETS: usize = 1 << 16;

impl Block {
    /// Number of records.
    pub(crate) fn len(&self) -> usize {
        self.positions[0].len()
    }

    /// Empties the block for a dataset with `attributes` beside the position.
    pub(crate) fn reset(&mut self, attributes: usize) {
        self.positions.iter_mut().chain(&mut self.truncated).for_each(Vec::clear);
        self.words.resize_with(attributes, Vec::new);
        self.words.iter_mut().for_each(Vec::clear);
        self.residues.clear();
        self.keep.clear();
        self.moved.clear();
    }

    /// Position of a record.
    pub(crate) fn position(&self, i: usize) -> [i64; 3] {
        [self.positions[0][i], self.positions[1][i], self.positions[2][i]]
    }

    /// Starts the hashes of all records with every attribute but `except`.
    pub(crate) fn start_hashes(&mut self, attributes: &[Attribute], except: Option<usize>) {
        self.states.clear();
        self.states.resize(self.len(), SEEDS);
        for (i, attribute) in attributes.iter().enumerate().filter(|(i, _)| Some(*i) != except) {
            let words = self.words[i].chunks_exact(attribute.elements);
            for (state, words) in self.states.iter_mut().zip(words) {
                *state = words.iter().fold(*state, |s, w| mix(s, *w));
            }
        }
    }

    /// The hash of record `i`: what [`Self::start_hashes`] took in, then `last` (three words), then the position.
    #[inline]
    pub(crate) fn hash(&self, i: usize, last: Option<[u64; 3]>, position: [i64; 3]) -> u128 {
        let mut state = self.states[i];
        if let Some(last) = last {
            state = last.iter().fold(state, |s, w| mix(s, *w));
        }
        state = position.iter().fold(state, |s, v| mix(s, *v as u64));
        u128::from(state[0]) | u128::from(state[1]) << 64
    }

    /// The whole record: x, y, z, then the words of all attributes.
    pub(crate) fn row(&self, i: usize, attributes: &[Attribute]) -> Box<[u64]> {
        let position = self.position(i).map(|v| v as u64);
        let words = attributes.iter().zip(&self.words);
        let values = words.flat_map(|(a, w)| w[i * a.elements..(i + 1) * a.elements].iter().copied());
        position.into_iter().chain(values).collect()
    }
}

/// Appends the bits of `points` values of `column` (from point `start` on, `elements` a point) as `attribute` stores
/// them. A column of another type is converted, integers by their low bytes, so that −1 as int8 is 255 as uint8;
/// missing columns and elements are zero.
pub(crate) fn append_words(
    column: Option<(&Column, usize)>,
    start: usize,
    points: usize,
    attribute: &Attribute,
    out: &mut Vec<u64>,
) {
    let Some((column, elements)) = column else {
        out.resize(out.len() + points * attribute.elements, 0);
        return;
    };
    let ty = attribute.ty;
    if elements != attribute.elements {
        for point in start..start + points {
            for element in 0..attribute.elements {
                let at = point * elements + element;
                let missing = element >= elements;
                out.push(if missing { 0 } else { with_column!(column, v => v.get(at).map_or(0, |x| x.bits(ty))) });
            }
        }
        return;
    }
    let (from, to) = (start * elements, (start + points) * elements);
    with_column!(column, values => {
        out.extend(values.get(from..to).unwrap_or_default().iter().map(|v| v.bits(ty)));
    });
    out.resize(out.len().next_multiple_of(attribute.elements), 0);
}

/// Words of values that their type does not hold; no stored value has such a word. Doubles have all words: the inverse of
/// the nearest one stands for such a value there.
const UNFIT: u64 = 1 << 63;

/// [`append_words`] of as many elements as the attribute has, where values that its type does not hold exactly are no
/// values of it.
pub(crate) fn append_exact_words(
    column: &Column,
    start: usize,
    points: usize,
    attribute: &Attribute,
    out: &mut Vec<u64>,
) {
    let (ty, elements) = (attribute.ty, attribute.elements);
    if column.ty() == ty {
        return append_words(Some((column, elements)), start, points, attribute, out);
    }
    let unfit = |word: u64| if ty.size() < 8 { word | UNFIT } else { !word };
    with_column!(column, values => {
        let values = values.get(start * elements..(start + points) * elements).unwrap_or_default();
        out.extend(values.iter().map(|v| if v.fits(ty) { v.bits(ty) } else { unfit(v.bits(ty)) }));
    });
    out.resize(out.len().next_multiple_of(elements), 0);
}

/// A value that can be stored as another type.
trait Bits: Copy {
    fn bits(self, ty: AttributeType) -> u64;

    /// True if the other type holds it exactly.
    fn fits(self, ty: AttributeType) -> bool;
}

macro_rules! bits {
    ($($t:ty),*) => {$(
        impl Bits for $t {
            #[inline]
            fn bits(self, ty: AttributeType) -> u64 {
                match ty {
                    AttributeType::Int8 | AttributeType::UInt8 => self as i64 as u64 & 0xff,
                    AttributeType::Int16 | AttributeType::UInt16 => self as i64 as u64 & 0xffff,
                    AttributeType::Int32 | AttributeType::UInt32 => self as i64 as u64 & 0xffff_ffff,
                    AttributeType::Int64 => self as i64 as u64,
                    AttributeType::UInt64 => self as u64,
                    AttributeType::Float32 => u64::from((self as f32).to_bits()),
                    AttributeType::Float64 => (self as f64).to_bits(),
                }
            }

            #[inline]
            fn fits(self, ty: AttributeType) -> bool {
                let whole = self as i128;
                let is_whole = whole as $t == self;
                match ty {
                    AttributeType::Int8 => is_whole && i8::try_from(whole).is_ok(),
                    AttributeType::UInt8 => is_whole && u8::try_from(whole).is_ok(),
                    AttributeType::Int16 => is_whole && i16::try_from(whole).is_ok(),
                    AttributeType::UInt16 => is_whole && u16::try_from(whole).is_ok(),
                    AttributeType::Int32 => is_whole && i32::try_from(whole).is_ok(),
                    AttributeType::UInt32 => is_whole && u32::try_from(whole).is_ok(),
                    AttributeType::Int64 => is_whole && i64::try_from(whole).is_ok(),
                    AttributeType::UInt64 => is_whole && u64::try_from(whole).is_ok(),
                    // NaN is not equal to itself, and stays what it is
                    AttributeType::Float32 => {
                        let single = self as f32;
                        single.is_nan() || single as $t == self && single as i128 == whole
                    }
                    AttributeType::Float64 => {
                        let double = self as f64;
                        double.is_nan() || double as $t == self && double as i128 == whole
                    }
                }
            }
        }
    )*};
}
bits!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// The number that `word`, the bits of a value of the type, stands for; of 64-bit integers the nearest double.
pub(crate) fn number(word: u64, ty: AttributeType) -> f64 {
    match ty {
        AttributeType::Int8 => f64::from(word as i8),
        AttributeType::Int16 => f64::from(word as i16),
        AttributeType::Int32 => f64::from(word as i32),
        AttributeType::Int64 => word as i64 as f64,
        AttributeType::UInt8 | AttributeType::UInt16 | AttributeType::UInt32 | AttributeType::UInt64 => word as f64,
        AttributeType::Float32 => f64::from(f32::from_bits(word as u32)),
        AttributeType::Float64 => f64::from_bits(word),
    }
}

/// The number that `word` stands for, for people.
pub(crate) fn value(word: u64, ty: AttributeType) -> serde_json::Value {
    if ty.size() < 8 && word & UNFIT != 0 {
        return format!("a value that {ty} does not hold").into();
    }
    match ty {
        AttributeType::Int8 => (word as i8).into(),
        AttributeType::Int16 => (word as i16).into(),
        AttributeType::Int32 => (word as i32).into(),
        AttributeType::Int64 => (word as i64).into(),
        AttributeType::UInt8 | AttributeType::UInt16 | AttributeType::UInt32 | AttributeType::UInt64 => word.into(),
        AttributeType::Float32 => f32::from_bits(word as u32).into(),
        AttributeType::Float64 => f64::from_bits(word).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_convert_by_their_low_bytes_and_back() {
        let mut out = Vec::new();
        let column = Column::Int8(vec![-18, 5]);
        append_words(Some((&column, 1)), 0, 2, &Attribute::new("a", AttributeType::UInt8, 1), &mut out);
        assert_eq!(out, [238, 5]);
        assert_eq!(value(238, AttributeType::Int8), -18);
        out.clear();
        append_words(Some((&column, 1)), 1, 1, &Attribute::new("a", AttributeType::Float64, 1), &mut out);
        assert_eq!(value(out[0], AttributeType::Float64), 5.0);
    }

    #[test]
    fn what_a_type_does_not_hold_is_no_value_of_it() {
        let words = |column: &Column, ty| {
            let mut out = Vec::new();
            append_exact_words(column, 0, column.len(), &Attribute::new("a", ty, 1), &mut out);
            out
        };
        assert_eq!(words(&Column::Int8(vec![-1, 5]), AttributeType::Int16), [0xffff, 5]);
        let narrow = words(&Column::Int32(vec![-1, 255, 300]), AttributeType::UInt8);
        assert_eq!((narrow[0] > 255, narrow[1], narrow[2] > 255), (true, 255, true));
        assert_eq!(value(narrow[0], AttributeType::UInt8), "a value that uint8 does not hold");
        let wide = words(&Column::UInt64(vec![1 << 53, (1 << 53) + 1]), AttributeType::Float64);
        let double = |v: u64| (v as f64).to_bits();
        assert_eq!((wide[0], wide[1]), (double(1 << 53), !double((1 << 53) + 1)));
        assert!(!i64::MAX.fits(AttributeType::Float64) && !0.5f64.fits(AttributeType::UInt8));
        assert!(f32::NAN.fits(AttributeType::Float64) && !1e300f64.fits(AttributeType::Float32));
    }

    #[test]
    fn a_hash_depends_on_every_word_and_its_place() {
        let hash = |words: &[u64]| words.iter().fold(SEEDS, |s, w| mix(s, *w));
        let variants: [&[u64]; 6] = [&[0, 0], &[0, 1], &[1, 0], &[1, 1], &[0], &[0, 0, 0]];
        let mut hashes: Vec<_> = variants.iter().map(|v| hash(v)).collect();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), variants.len());
    }
}
