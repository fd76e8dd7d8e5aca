//! Where a hierarchy is cut into chunks.

use super::{Keyed, LinkedTree};

/// The roots of the chunks, in breadth-first order, if a chunk should have at most `most` records.
pub(crate) fn chunk_roots(tree: &LinkedTree<'_, impl Keyed>, most: usize) -> Vec<usize> {
    let mut roots = Vec::new();
    let mut waiting = vec![0];
    while let Some(root) = waiting.pop() {
        roots.push(root);
        waiting.extend(cut(tree, root, most));
    }
    roots.sort_unstable();
    roots
}

/// The nodes below `root` that get chunks of their own.
///
/// Whole levels come first, because renderers load by levels: a first picture should meet no proxy. They get half of
/// the room only. The rest goes to the smallest subtrees below them, or there would be many chunks of a few records,
/// each of which costs a request.
fn cut(tree: &LinkedTree<'_, impl Keyed>, root: usize, most: usize) -> Vec<usize> {
    if tree.size(root) <= most {
        return Vec::new();
    }
    let (mut records, mut border) = (0, root..root);
    for (depth, level) in tree.levels(root).enumerate() {
        // Without the children the same node would be cut again for ever.
        if depth > 1 && records + level.len() > most / 2 {
            break;
        }
        records += level.len();
        border = level;
    }
    let mut own: Vec<(usize, usize)> =
        border.filter(|n| !tree.children(*n).is_empty()).map(|n| (tree.size(n), n)).collect();
    own.sort_unstable();
    let fits = |(size, _): &&(usize, usize)| {
        records += size - 1;
        records <= most
    };
    let whole = own.iter().take_while(fits).count();
    own.into_iter().skip(whole).map(|(_, node)| node).collect()
}
