//! Values that viewers do not show as they are meant, counted while payloads are made.

use std::sync::Mutex;

use pointmill_format::{Attribute, AttributeType, Changes};
use serde::{Deserialize, Serialize};

use super::settings::DarkColours;
use crate::cloud::Range;
use crate::sources::POSITION_BYTES;

/// Potree hides points above it.
const MOST_RETURNS: u8 = 7;

/// The greatest channel that viewers take for 8 bits.
const DARKEST: u16 = 255;

/// Where the values are in records of the output. Nothing is looked at that the ranges rule out.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watch {
    /// Byte offset of the colour.
    rgb: Option<usize>,
    /// Byte offsets of the return number and the number of returns.
    returns: Vec<usize>,
    rounds: bool,
}

/// What was seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Seen {
    /// Points with a dark channel.
    pub(crate) dark_points: u64,
    /// Dark channels that were rounded.
    pub(crate) rounded: Changes,
    /// Points with more than seven returns.
    pub(crate) many_returns: u64,
}

impl Seen {
    pub(crate) fn merge(&mut self, other: &Self) {
        self.dark_points += other.dark_points;
        self.rounded.merge(&other.rounded);
        self.many_returns += other.many_returns;
    }
}

/// What all threads have seen.
#[derive(Debug, Default)]
pub(crate) struct AllSeen(Mutex<Seen>);

impl AllSeen {
    pub(crate) fn add(&self, seen: &Seen) {
        if *seen != Seen::default() {
            self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).merge(seen);
        }
    }

    pub(crate) fn total(&self) -> Seen {
        *self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Watch {
    /// `attributes`: those of the output beside the position, with their ranges in the cloud. `is_deep`: the colours of
    /// some source have 16 bits.
    pub(super) fn new<'a>(
        attributes: impl Iterator<Item = (&'a Attribute, &'a Range)>,
        is_deep: bool,
        colours: DarkColours,
    ) -> Self {
        let (mut watch, mut at) = (Self { rounds: colours == DarkColours::Round, ..Self::default() }, POSITION_BYTES);
        for (attribute, range) in attributes {
            let is_of = |ty, elements| attribute.ty == ty && attribute.elements == elements;
            match attribute.name.as_str() {
                "rgb" if is_deep && is_of(AttributeType::UInt16, 3) => watch.rgb = Some(at),
                "return number" | "number of returns"
                    if is_of(AttributeType::UInt8, 1) && range.max[0] > f64::from(MOST_RETURNS) =>
                {
                    watch.returns.push(at);
                }
                _ => {}
            }
            at += attribute.size();
        }
        watch
    }

    /// Looks at records of the output, and rounds where this was asked for.
    pub(crate) fn look(&self, records: &mut [u8], stride: usize, seen: &mut Seen) {
        if let Some(at) = self.rgb {
            for record in records.chunks_exact_mut(stride) {
                let Some(colour) = record.get_mut(at..at + 6) else { return };
                let channels = colour.as_chunks_mut::<2>().0;
                let is_dark = |c: &[u8; 2]| (1..=DARKEST).contains(&u16::from_le_bytes(*c));
                if channels.iter().any(is_dark) {
                    seen.dark_points += 1;
                    if self.rounds {
                        channels.iter_mut().filter(|c| is_dark(c)).for_each(|c| round(c, &mut seen.rounded));
                    }
                }
            }
        }
        if !self.returns.is_empty() {
            let many = |record: &[u8]| self.returns.iter().any(|at| record.get(*at).is_some_and(|n| *n > MOST_RETURNS));
            seen.many_returns += records.chunks_exact(stride).filter(|record| many(record)).count() as u64;
        }
    }
}

fn round(channel: &mut [u8; 2], rounded: &mut Changes) {
    let value = u16::from_le_bytes(*channel);
    rounded.round(f64::from(value));
    *channel = rounded_channel(value).to_le_bytes();
}

/// The nearest channel that viewers show as it is meant.
fn rounded_channel(value: u16) -> u16 {
    match value {
        0..128 => 0,
        128..=DARKEST => 256,
        _ => value,
    }
}

/// The range of rounded colours: rounding keeps the order.
pub(super) fn rounded_range(range: &Range) -> Range {
    let rounded = |v: &f64| if (0.0..=65535.0).contains(v) { f64::from(rounded_channel(*v as u16)) } else { *v };
    let mut range = range.clone();
    range.min.iter_mut().chain(&mut range.max).for_each(|v| *v = rounded(v));
    range
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRIDE: usize = 19;

    fn records() -> Vec<u8> {
        let record = |rgb: [u16; 3], returns: u8| {
            let mut bytes = vec![1; POSITION_BYTES];
            bytes.extend(rgb.iter().flat_map(|v| v.to_le_bytes()));
            bytes.push(returns);
            bytes
        };
        [record([0, 256, 65535], 7), record([127, 128, 255], 8), record([300, 1, 0], 15)].concat()
    }

    fn watch(colours: DarkColours, most: f64) -> Watch {
        let attributes = [
            Attribute::new("rgb", AttributeType::UInt16, 3),
            Attribute::new("number of returns", AttributeType::UInt8, 1),
        ];
        let mut ranges = [Range::new(3), Range::new(1)];
        ranges[1].add(most);
        Watch::new(attributes.iter().zip(&ranges), true, colours)
    }

    #[test]
    fn points_are_counted_once_and_stay_as_they_are() {
        let (mut seen, mut bytes) = (Seen::default(), records());
        watch(DarkColours::Keep, 15.0).look(&mut bytes, STRIDE, &mut seen);
        assert_eq!((seen.dark_points, seen.many_returns, seen.rounded.rounded), (2, 2, 0));
        assert_eq!(bytes, records());
        let mut few = Seen::default();
        watch(DarkColours::Keep, 7.0).look(&mut bytes, STRIDE, &mut few);
        assert_eq!(few.many_returns, 0);
    }

    #[test]
    fn dark_channels_become_the_nearest_of_0_and_256() {
        let (mut seen, mut bytes) = (Seen::default(), records());
        watch(DarkColours::Round, 15.0).look(&mut bytes, STRIDE, &mut seen);
        let colours: Vec<u16> = bytes
            .chunks_exact(STRIDE)
            .flat_map(|r| r[12..18].as_chunks::<2>().0.iter().map(|c| u16::from_le_bytes(*c)).collect::<Vec<_>>())
            .collect();
        assert_eq!(colours, [0, 256, 65535, 0, 256, 256, 300, 0, 0]);
        assert_eq!((seen.rounded.rounded, seen.rounded.extremes), (4, Some([1.0, 255.0])));
    }

    #[test]
    fn rounded_ranges_bound_rounded_values() {
        let mut range = Range::new(2);
        (range.min, range.max) = (vec![37.0, 130.0], vec![200.0, 40_000.0]);
        let rounded = rounded_range(&range);
        assert_eq!((rounded.min, rounded.max), (vec![0.0, 256.0], vec![256.0, 40_000.0]));
    }
}
