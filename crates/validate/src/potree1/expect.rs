//! Names of files and corners of nodes as the format defines them (`docs/formats/potree1.md`), computed here.
//!
//! The format crate knows how to do this too. It is repeated on purpose: a validator that borrows the arithmetic of the
//! program it checks agrees with its mistakes.

use pointmill_format::NodeKey;

/// The folder of a node's files below that of `cloud.js`, by the digits of its name.
fn folder(octree_dir: &str, digits: &str, step: usize) -> String {
    let mut folder = format!("{octree_dir}/r");
    let mut rest = digits;
    while rest.len() >= step {
        let (group, after) = rest.split_at(step);
        folder.push('/');
        folder.push_str(group);
        rest = after;
    }
    folder
}

/// The names of a dataset's files.
#[derive(Debug, Clone)]
pub(crate) struct Names {
    pub(crate) octree_dir: String,
    /// Levels of a folder; at least 1.
    pub(crate) step: u32,
    /// With the dot.
    pub(crate) extension: &'static str,
    /// False in version 1.4: all nodes are in one folder.
    pub(crate) has_folders: bool,
}

impl Names {
    /// The file with a node's points.
    pub(crate) fn node(&self, key: NodeKey) -> String {
        if self.has_folders {
            self.file(key, self.extension)
        } else {
            format!("{}/{key}{}", self.octree_dir, self.extension)
        }
    }

    /// The index that begins with a node.
    pub(crate) fn index(&self, key: NodeKey) -> String {
        self.file(key, ".hrc")
    }

    fn file(&self, key: NodeKey, extension: &str) -> String {
        let name = key.to_string();
        let step = usize::try_from(self.step).unwrap_or(usize::MAX);
        format!("{}/{name}{extension}", folder(&self.octree_dir, &name[1..], step))
    }

    /// True if nodes of that level begin an index, if they have children.
    pub(crate) fn begins_index(&self, level: u8) -> bool {
        self.has_folders && u32::from(level).is_multiple_of(self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_where_the_page_says() {
        let mut names = Names { octree_dir: "data".into(), step: 5, extension: ".bin", has_folders: true };
        let key = |name: &str| name.parse::<NodeKey>().unwrap();
        assert_eq!(names.node(key("r0736")), "data/r/r0736.bin");
        assert_eq!(names.index(key("r01234")), "data/r/01234/r01234.hrc");
        assert_eq!(names.node(key("r0123456701")), "data/r/01234/56701/r0123456701.bin");
        assert_eq!([0, 4, 5, 10].map(|level| names.begins_index(level)), [true, false, true, true]);
        names.has_folders = false;
        assert!(!names.begins_index(0));
        assert_eq!(names.node(key("r012345")), "data/r012345.bin");
    }
}
