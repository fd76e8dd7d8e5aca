//! The layers of formats 6–10 beside the base: one field each.

use super::base::{CHANNEL_BITS, FLAGS_AT};
use super::channels::{Channels, Layer, Meta, State};
use super::coder::Coder;
use super::family::{BytesFamily, FlagsFamily};
use super::gps_time::GpsTime;
use super::integer::Integer;

/// Where the fields are in a record.
const Z_AT: usize = 8;
const INTENSITY_AT: usize = 12;
const CLASS_AT: usize = 16;
const USER_AT: usize = 17;
const ANGLE_AT: usize = 18;
const SOURCE_AT: usize = 20;
const TIME_AT: usize = 22;

/// `N` bytes of a record; zeros beyond its end.
pub(super) fn read<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
    record.get(at..).and_then(|bytes| bytes.first_chunk()).copied().unwrap_or([0; N])
}

#[inline(always)]
pub(super) fn write<const N: usize>(record: &mut [u8], at: usize, bytes: [u8; N]) {
    if let Some(place) = record.get_mut(at..).and_then(|rest| rest.first_chunk_mut()) {
        *place = bytes;
    }
}

/// A field of which each channel has a state, decoded by `next`.
pub(super) trait Field: State {
    /// The value in a record.
    fn of(record: &[u8]) -> Self::Value;

    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]);
}

/// The layer of a field.
#[derive(Debug)]
pub(super) struct FieldLayer<S> {
    channels: Channels<S>,
}

impl<S: State> FieldLayer<S> {
    pub(super) fn new() -> Self {
        Self { channels: Channels::new() }
    }
}

impl<S: Field> Layer for FieldLayer<S> {
    fn start(&mut self, first: &[u8], channel: u8) {
        self.channels.of(channel).start(S::of(first));
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        if meta.is_new {
            self.channels.open(meta.channel, meta.from);
        }
        self.channels.of(meta.channel).next(coder, meta, record);
    }
}

/// z, predicted from the last one of the same level.
#[derive(Debug)]
pub(super) struct Z {
    last: i32,
    heights: [i32; 8],
    integer: Integer,
}

impl State for Z {
    type Value = i32;

    fn new() -> Self {
        Self { last: 0, heights: [0; 8], integer: Integer::new(32, 20) }
    }

    fn start(&mut self, last: i32) {
        (self.last, self.heights) = (last, [last; 8]);
        self.integer.reset();
    }

    fn last(&self) -> i32 {
        self.last
    }
}

impl Field for Z {
    fn of(record: &[u8]) -> i32 {
        i32::from_le_bytes(read(record, Z_AT))
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        let height = &mut self.heights[usize::from(meta.level & 7)];
        *height = self.integer.next(coder, *height, usize::from(meta.z_context));
        self.last = *height;
        write(record, Z_AT, height.to_le_bytes());
    }
}

/// Intensity, predicted from the last one of a return of the same place.
#[derive(Debug)]
pub(super) struct Intensity {
    last: u16,
    of_place: [u16; 8],
    integer: Integer,
}

impl State for Intensity {
    type Value = u16;

    fn new() -> Self {
        Self { last: 0, of_place: [0; 8], integer: Integer::new(16, 4) }
    }

    fn start(&mut self, last: u16) {
        (self.last, self.of_place) = (last, [last; 8]);
        self.integer.reset();
    }

    fn last(&self) -> u16 {
        self.last
    }
}

impl Field for Intensity {
    fn of(record: &[u8]) -> u16 {
        u16::from_le_bytes(read(record, INTENSITY_AT))
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        let place = usize::from(meta.place & 3);
        let value = &mut self.of_place[place << 1 | usize::from(meta.new_time)];
        *value = self.integer.next(coder, i32::from(*value), place) as u16;
        self.last = *value;
        write(record, INTENSITY_AT, value.to_le_bytes());
    }
}

/// A field of 16 bits that says only where it differs from the last one.
macro_rules! seldom {
    ($(#[$doc:meta])* $name:ident, $ty:ty, $at:expr, $contexts:literal, |$meta:ident| $is_new:expr, $context:expr) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub(super) struct $name {
            last: $ty,
            integer: Integer,
        }

        impl State for $name {
            type Value = $ty;

            fn new() -> Self {
                Self { last: 0, integer: Integer::new(16, $contexts) }
            }

            fn start(&mut self, last: $ty) {
                self.last = last;
                self.integer.reset();
            }

            fn last(&self) -> $ty {
                self.last
            }
        }

        impl Field for $name {
            fn of(record: &[u8]) -> $ty {
                <$ty>::from_le_bytes(read(record, $at))
            }

            #[inline(always)]
            fn next(&mut self, coder: &mut Coder<'_>, $meta: &Meta, record: &mut [u8]) {
                if $is_new {
                    self.last = self.integer.next(coder, i32::from(self.last), $context) as $ty;
                }
                write(record, $at, self.last.to_le_bytes());
            }
        }
    };
}

seldom!(
    /// Scan angle.
    Angle, i16, ANGLE_AT, 2, |meta| meta.new_angle, usize::from(meta.new_time)
);
seldom!(
    /// Point source id.
    Source, u16, SOURCE_AT, 1, |meta| meta.new_source, 0
);

/// A field of up to eight bits with a model for each context that follows from the last value.
macro_rules! symbols {
    ($(#[$doc:meta])* $name:ident, $family:ident, $symbols:literal) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub(super) struct $name {
            last: u8,
            models: $family,
        }

        impl State for $name {
            type Value = u8;

            fn new() -> Self {
                Self { last: 0, models: $family::new($symbols) }
            }

            fn start(&mut self, last: u8) {
                self.last = last;
                self.models.reset();
            }

            fn last(&self) -> u8 {
                self.last
            }
        }
    };
}

symbols!(
    /// Class.
    Class, BytesFamily, 256
);
symbols!(
    /// User data.
    User, BytesFamily, 256
);
symbols!(
    /// Classification flags (four bits), scan direction, edge of the flight line.
    PointFlags, FlagsFamily, 64
);

impl Field for Class {
    fn of(record: &[u8]) -> u8 {
        read::<1>(record, CLASS_AT)[0]
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        let is_single = u8::from(meta.place == 3);
        self.last = coder.symbol(self.models.of((self.last & 31) << 1 | is_single)) as u8;
        write(record, CLASS_AT, [self.last]);
    }
}

impl Field for User {
    fn of(record: &[u8]) -> u8 {
        read::<1>(record, USER_AT)[0]
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, _: &Meta, record: &mut [u8]) {
        self.last = coder.symbol(self.models.of(self.last / 4)) as u8;
        write(record, USER_AT, [self.last]);
    }
}

impl Field for PointFlags {
    fn of(record: &[u8]) -> u8 {
        let [flags] = read(record, FLAGS_AT);
        flags & 15 | flags >> 2 & 0b11_0000
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        self.last = coder.symbol(self.models.of(self.last)) as u8;
        let channel = meta.channel << 4 & CHANNEL_BITS;
        write(record, FLAGS_AT, [self.last & 15 | channel | (self.last & 0b11_0000) << 2]);
    }
}

impl State for GpsTime {
    type Value = i64;

    fn new() -> Self {
        Self::new(false)
    }

    fn start(&mut self, last: i64) {
        Self::start(self, last);
    }

    fn last(&self) -> i64 {
        self.time()
    }
}

impl Field for GpsTime {
    fn of(record: &[u8]) -> i64 {
        i64::from_le_bytes(read(record, TIME_AT))
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        let time = if meta.new_time { Self::next(self, coder) } else { self.time() };
        write(record, TIME_AT, time.to_le_bytes());
    }
}
