//! Where the files of nodes are.

use std::fmt::Write;

use crate::NodeKey;

/// The file of a node below the octree's folder, without its extension: `r/01234/r0123456`. Its folders are the complete groups
/// of `step` digits of its name.
///
/// ```
/// use pointmill_format::{NodeKey, potree1::node_path};
///
/// let path = |name: &str| name.parse().map(|key: NodeKey| node_path(key, 5));
/// assert_eq!(path("r0736")?, "r/r0736");
/// assert_eq!(path("r01234")?, "r/01234/r01234");
/// assert_eq!(path("r0123456701")?, "r/01234/56701/r0123456701");
/// # Ok::<(), pointmill_format::UnknownName>(())
/// ```
#[must_use]
pub fn node_path(key: NodeKey, step: u32) -> String {
    let mut path = folder(key, step);
    // Writing to a string cannot fail.
    let _ = write!(path, "/{key}");
    path
}

/// The folder of a node below the octree's folder: `r/01234`.
fn folder(key: NodeKey, step: u32) -> String {
    let name = key.to_string();
    let digits = &name[1..];
    let step = usize::try_from(step.max(1)).unwrap_or(usize::MAX);
    let mut folder = String::from("r");
    for group in digits.as_bytes().chunks_exact(step) {
        folder.push('/');
        folder.extend(group.iter().map(|digit| char::from(*digit)));
    }
    folder
}

/// True if an `.hrc` begins with nodes of that level.
#[must_use]
pub fn begins_index(level: u8, step: u32) -> bool {
    u32::from(level).is_multiple_of(step.max(1))
}
