//! The address of an octree node.

use std::fmt;
use std::str::FromStr;

use super::morton::morton32;
use crate::UnknownName;

/// Address of an octree node: its level (root = 0) and its cell in the `2^level` grid of that level.
///
/// Child index is `4·x + 2·y + z` of the lowest cell bits (x owns bit 2), as Potree spells it: `r042` is child 2 of
/// child 4 of child 0 of the root. Levels reach 31, so that cells fit 31 bits.
///
/// ```
/// use pointmill_format::NodeKey;
///
/// let key: NodeKey = "r042".parse()?;
/// assert_eq!((key.level, key.x, key.y, key.z), (3, 2, 1, 0));
/// assert_eq!(key.parent().map(|p| p.to_string()), Some("r04".to_owned()));
/// # Ok::<(), pointmill_format::UnknownName>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeKey {
    /// 0 for the root.
    pub level: u8,
    /// Cell along x, `0..2^level`.
    pub x: u32,
    /// Cell along y, `0..2^level`.
    pub y: u32,
    /// Cell along z, `0..2^level`.
    pub z: u32,
}

impl NodeKey {
    /// The root.
    pub const ROOT: Self = Self { level: 0, x: 0, y: 0, z: 0 };

    /// The deepest level that a key can address.
    pub const MAX_LEVEL: u8 = 31;

    /// The child with index `child` (0–7; x is bit 2, y bit 1, z bit 0), or `None` below [`Self::MAX_LEVEL`].
    #[must_use]
    pub fn child(self, child: u8) -> Option<Self> {
        (self.level < Self::MAX_LEVEL && child < 8).then(|| Self {
            level: self.level + 1,
            x: self.x << 1 | u32::from(child >> 2 & 1),
            y: self.y << 1 | u32::from(child >> 1 & 1),
            z: self.z << 1 | u32::from(child & 1),
        })
    }

    /// The parent, or `None` for the root.
    #[must_use]
    pub fn parent(self) -> Option<Self> {
        (self.level > 0).then(|| Self { level: self.level - 1, x: self.x >> 1, y: self.y >> 1, z: self.z >> 1 })
    }

    /// Index of this node among its parent's children (0–7); 0 for the root.
    pub fn child_index(self) -> u8 {
        ((self.x & 1) << 2 | (self.y & 1) << 1 | (self.z & 1)) as u8
    }

    /// The ancestor at `level` (itself if `level` is its own), or `None` if `level` is deeper than this node.
    #[must_use]
    pub fn ancestor(self, level: u8) -> Option<Self> {
        let up = self.level.checked_sub(level)?;
        let above = |cell: u32| cell.checked_shr(up.into()).unwrap_or(0);
        Some(Self { level, x: above(self.x), y: above(self.y), z: above(self.z) })
    }

    /// Where the node stands in breadth-first order: the level in the top bits, then the digits of the name.
    pub(crate) fn breadth_first_rank(self) -> u128 {
        u128::from(self.level) << 96 | morton32([self.z, self.y, self.x])
    }

    /// Parses a Potree name: `r` and one digit 0–7 per level.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let digits = name.strip_prefix('r')?;
        digits.bytes().try_fold(Self::ROOT, |key, b| key.child(b.checked_sub(b'0').filter(|d| *d < 8)?))
    }
}

impl FromStr for NodeKey {
    type Err = UnknownName;

    /// [`Self::from_name`].
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        Self::from_name(name)
            .ok_or_else(|| UnknownName::new(name, "node", &["r, and r with a digit of 0 to 7 per level"]))
    }
}

impl fmt::Display for NodeKey {
    /// The Potree name: `r`, `r0`, `r042`, …
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("r")?;
        for level in 1..=self.level {
            let up = u32::from(self.level - level);
            let bit = |cell: u32| cell.checked_shr(up).unwrap_or(0) & 1;
            let digit = bit(self.x) << 2 | bit(self.y) << 1 | bit(self.z);
            write!(f, "{digit}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_children_know_their_parent() {
        let key: NodeKey = "r0427".parse().unwrap();
        assert_eq!(key.to_string(), "r0427");
        assert_eq!(key.child_index(), 7);
        assert_eq!(key.parent().unwrap().to_string(), "r042");
        assert_eq!(key.ancestor(1).unwrap().to_string(), "r0");
        assert_eq!(NodeKey::from_name("r8"), None);
        assert_eq!(NodeKey::from_name("042"), None);
    }

    #[test]
    fn a_level_beyond_all_bits_does_no_harm() {
        let key = NodeKey { level: 40, x: 5, y: 0, z: 1 };
        assert_eq!(key.to_string(), format!("r{}405", "0".repeat(37)));
        assert_eq!(key.ancestor(3), Some(NodeKey { level: 3, x: 0, y: 0, z: 0 }));
    }

    #[test]
    fn the_deepest_level_is_reachable_and_no_deeper() {
        let deepest = NodeKey::from_name(&format!("r{}", "7".repeat(31))).unwrap();
        assert_eq!(deepest.x, (1 << 31) - 1);
        assert_eq!(deepest.child(0), None);
    }

    #[test]
    fn ranks_order_nodes_by_level_and_then_by_name() {
        let deep = format!("r{}", "0".repeat(31));
        let names = ["r", "r0", "r3", "r7", "r00", "r04", "r40", "r777", &deep];
        let ranks = names.map(|n| NodeKey::from_name(n).unwrap().breadth_first_rank());
        assert!(ranks.is_sorted_by(|a, b| a < b), "{ranks:x?}");
    }

    #[test]
    fn every_child_knows_its_place() {
        let parent: NodeKey = "r0427".parse().unwrap();
        for child in 0..8 {
            let key = parent.child(child).unwrap();
            assert_eq!(
                (key.child_index(), key.parent(), key.to_string()),
                (child, Some(parent), format!("r0427{child}"))
            );
        }
        assert_eq!([parent.child(8), NodeKey::ROOT.parent()], [None, None]);
    }
}
