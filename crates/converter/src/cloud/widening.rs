//! Colours of 8 bits become 16: which records have such, as blocks of the store know them.

/// Sources whose records may share a block, because their colours are of one depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Group(pub(crate) u32);

impl Group {
    /// Sources whose colours stay as they are, and those without.
    pub(crate) const WIDE: Self = Self(0);
    /// Sources whose colours are 8 bits deep, as was stated.
    pub(crate) const NARROW: Self = Self(1);

    /// One source, whose depth is known when all of it was read.
    pub(crate) const fn of_source(index: usize) -> Self {
        Self(index as u32 + 2)
    }
}

/// Which stored colours are 8 bits deep.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Widening {
    /// Byte offset of the colour in a stored record; `None`: there is none.
    rgb: Option<usize>,
    /// By source; empty if none is narrow.
    sources: Vec<bool>,
}

impl Widening {
    /// `rgb`: byte offset of the colour in a stored record; `sources`: by source, whether its colours have 8 bits.
    pub(crate) fn new(rgb: Option<usize>, sources: Vec<bool>) -> Self {
        Self { rgb, sources }
    }

    /// True if the colours of a source have 8 bits.
    pub(crate) fn is_narrow(&self, source: usize) -> bool {
        self.sources.get(source).copied().unwrap_or(false)
    }

    /// Byte offset of a colour of 8 bits in the records of a block.
    pub(crate) fn of(&self, group: u32) -> Option<usize> {
        let is_narrow = match Group(group) {
            Group::WIDE => false,
            Group::NARROW => true,
            Group(n) => self.is_narrow(n as usize - 2),
        };
        self.rgb.filter(|_| is_narrow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_narrow_by_what_was_stated_or_by_its_source() {
        let widening = Widening::new(Some(12), vec![false, true]);
        let of = |group: Group| widening.of(group.0);
        assert_eq!([Group::WIDE, Group::NARROW].map(of), [None, Some(12)]);
        assert_eq!([0, 1].map(|i| of(Group::of_source(i))), [None, Some(12)]);
        assert_eq!(Widening::default().of(1), None);
    }
}
