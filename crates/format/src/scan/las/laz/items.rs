//! What a compressed record is made of.

/// An item of a record: some of its bytes, compressed in one way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) struct Item {
    pub(in super::super) kind: ItemKind,
    /// Bytes of a record.
    pub(in super::super) bytes: u16,
    /// Of the way in which it is compressed.
    pub(in super::super) version: u16,
}

/// The kinds of items, in LASzip's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum ItemKind {
    Byte = 0,
    Point10 = 6,
    GpsTime11 = 7,
    Rgb12 = 8,
    WavePacket13 = 9,
    Point14 = 10,
    Rgb14 = 11,
    RgbNir14 = 12,
    WavePacket14 = 13,
    Byte14 = 14,
}

impl ItemKind {
    const ALL: [Self; 10] = [
        Self::Byte,
        Self::Point10,
        Self::GpsTime11,
        Self::Rgb12,
        Self::WavePacket13,
        Self::Point14,
        Self::Rgb14,
        Self::RgbNir14,
        Self::WavePacket14,
        Self::Byte14,
    ];

    /// What LASzip calls it.
    pub(in super::super) const fn name(self) -> &'static str {
        match self {
            Self::Byte => "BYTE",
            Self::Point10 => "POINT10",
            Self::GpsTime11 => "GPSTIME11",
            Self::Rgb12 => "RGB12",
            Self::WavePacket13 => "WAVEPACKET13",
            Self::Point14 => "POINT14",
            Self::Rgb14 => "RGB14",
            Self::RgbNir14 => "RGBNIR14",
            Self::WavePacket14 => "WAVEPACKET14",
            Self::Byte14 => "BYTE14",
        }
    }

    /// The kind of that number in the LASzip record.
    pub(in super::super) fn of_number(number: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u16 == number)
    }

    /// Bytes of a record; `None` if it can be any number.
    pub(in super::super) fn bytes(self) -> Option<u16> {
        match self {
            Self::Byte | Self::Byte14 => None,
            Self::Point10 => Some(20),
            Self::GpsTime11 | Self::RgbNir14 => Some(8),
            Self::Rgb12 | Self::Rgb14 => Some(6),
            Self::WavePacket13 | Self::WavePacket14 => Some(29),
            Self::Point14 => Some(30),
        }
    }
}

/// Bytes of a record of these items.
pub(in super::super) fn record_len(items: &[Item]) -> usize {
    items.iter().map(|item| usize::from(item.bytes)).sum()
}
