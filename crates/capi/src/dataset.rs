//! A dataset that is open.

use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock};

use pointmill_format::batches::{Batches, MappedFile};
use pointmill_format::bintree::{Bintree, Picker};
use pointmill_format::octree::Octree as _;
use pointmill_format::{DatasetKind, ReadError, copc, locate, potree1, potree2};

use crate::about::{About, Colours};
use crate::axes::PmAxes;
use crate::border::text;
use crate::octree::Tree;
use crate::status::{Fault, Outcome, PM_API_VERSION, PmStatus, guard};

/// A dataset that is open. Calls may use it from several threads at once; pm_close() must be the last one.
pub struct PmDataset {
    pub(crate) content: Content,
    pub(crate) about: Arc<About>,
    pub(crate) axes: PmAxes,
    /// Found when the first points are decoded.
    pub(crate) colours: OnceLock<Option<Colours>>,
}

pub(crate) enum Content {
    Octree(Tree),
    Bintree(Leaves),
    Batches(Box<Batches<MappedFile>>),
}

/// A binary tree, with what its index does not say of each node.
pub(crate) struct Leaves {
    pub(crate) tree: Arc<Bintree>,
    /// Parent (PM_NO_NODE of the root) and depth, by node.
    pub(crate) places: Vec<(u32, u32)>,
    pub(crate) picker: Mutex<Picker>,
}

/// No node: the parent of a root.
pub const PM_NO_NODE: u32 = u32::MAX;

/// Leaves that a picker keeps, bytes.
const PICKER_BYTES: usize = 64 << 20;

impl Leaves {
    fn new(tree: Bintree) -> Self {
        let tree = Arc::new(tree);
        let mut places = vec![(PM_NO_NODE, 0); tree.nodes().len()];
        // preorder: a parent is settled before its children
        for index in 0..places.len() {
            let depth = places[index].1 + 1;
            for child in tree.children(index as u32).into_iter().flatten() {
                if let Some(place) = places.get_mut(child as usize) {
                    *place = (index as u32, depth);
                }
            }
        }
        let picker = Mutex::new(Picker::new(Arc::clone(&tree), PICKER_BYTES));
        Self { tree, places, picker }
    }
}

impl PmDataset {
    /// Opens what is at `path`.
    pub(crate) fn open(path: PathBuf, axes: PmAxes) -> Outcome<Self> {
        let located = locate(path)?;
        let (content, about) = match located.kind {
            DatasetKind::Potree2 => {
                let dataset = potree2::Dataset::open(&located.path)?;
                let about = About::of_potree2(dataset.info(), dataset.metadata());
                (Content::Octree(Tree::new(Box::new(dataset))?), about)
            }
            DatasetKind::Potree1 => {
                let dataset = potree1::Dataset::open(&located.path)?;
                let about = About::of_potree1(dataset.info(), dataset.metadata());
                (Content::Octree(Tree::new(Box::new(dataset))?), about)
            }
            DatasetKind::Copc => {
                let dataset = copc::Dataset::open(&located.path)?;
                let about = About::of_copc(dataset.info(), &dataset);
                (Content::Octree(Tree::new(Box::new(dataset))?), about)
            }
            DatasetKind::Bintree => {
                let tree = Bintree::open(&located.path)?;
                let about = About::of_bintree(&tree);
                (Content::Bintree(Leaves::new(tree)), about)
            }
            DatasetKind::Batches => {
                let batches = Batches::map(&located.path)?;
                let about = About::of_batches(&batches);
                (Content::Batches(Box::new(batches)), about)
            }
            other => {
                let what = format!("a {}, which this interface does not read", other.title());
                return Err(ReadError::unsupported(&located.path, what).into());
            }
        };
        Ok(Self { content, about: Arc::new(about), axes, colours: OnceLock::new() })
    }

    /// The fault of asking for what only another kind has.
    pub(crate) fn other_kind(&self, what: &str) -> Fault {
        Fault::new(PmStatus::Unsupported, format!("{what}; this is a dataset of kind {}", self.about.kind.title()))
    }
}

/// Opens the dataset at `path` (UTF-8): a folder, its marker file (metadata.json, cloud.js, index.json), a .qbatch file, a
/// COPC file, or an archive with a Potree 1.x dataset. The kind is detected.
///
/// `api_version`: PM_API_VERSION as the program was compiled with. `axes`: a value of PmAxes, for all that the handle takes
/// and gives. `*dataset` is the caller's and ends with pm_close(); it is NULL after an error.
///
/// Reads the metadata; of an octree the first chunk of the hierarchy, of a binary tree the index (about 110 bytes of
/// memory per node). Quantised batches are mapped: a file that another program cuts short meanwhile ends this one with
/// a signal (SIGBUS) when a lost page is touched.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_open(
    api_version: u32,
    path: *const c_char,
    axes: u32,
    dataset: Option<&mut MaybeUninit<Option<Box<PmDataset>>>>,
) -> PmStatus {
    guard(|| {
        let out = dataset.ok_or_else(|| Fault::null("dataset"))?;
        out.write(None);
        if !is_compatible(api_version) {
            let text = format!("the program asks for version {api_version} of the interface, this is {PM_API_VERSION}");
            return Err(Fault::new(PmStatus::Version, text));
        }
        // SAFETY: that the path ends is the caller's promise
        let path = unsafe { text(path, "path") }?;
        let path = path.to_str().map_err(|_| Fault::argument("path is not UTF-8"))?;
        out.write(Some(Box::new(PmDataset::open(path.into(), PmAxes::of(axes)?)?)));
        Ok(())
    })
}

/// The same thousands; no later than this.
fn is_compatible(api_version: u32) -> bool {
    api_version / 1000 == PM_API_VERSION / 1000 && api_version <= PM_API_VERSION
}

/// Closes a dataset: its handle, its texts and its mapped sections are gone; PmPoints live on. NULL does nothing. Closing a
/// handle twice, or while another thread uses it, is an error that cannot be detected.
#[unsafe(no_mangle)]
pub extern "C" fn pm_close(dataset: Option<Box<PmDataset>>) {
    guard(|| {
        drop(dataset);
        Ok(())
    });
}

/// The number of the interface that the library has: PM_API_VERSION of its header. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_api_version() -> u32 {
    PM_API_VERSION
}

/// The version of the library: "0.1.0". The text lives as long as the library. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::{fixture, last_error, open, try_open};

    #[test]
    fn every_kind_opens_and_closes() {
        for path in ["potree2/default", "potree2/brotli", "potree1/words", "copc/format8.copc.laz", "bintree/packed"] {
            pm_close(Some(open(path, PmAxes::ZUp)));
        }
        pm_close(None);
    }

    #[test]
    fn what_is_no_dataset_is_refused_with_a_line() {
        for (path, status, part) in [
            (fixture("las/format7.laz"), PmStatus::Unsupported, "not a dataset of any known kind"),
            (fixture("nothing"), PmStatus::Io, "nothing"),
        ] {
            assert_eq!(try_open(&path, 0).err(), Some(status));
            assert!(last_error().contains(part), "{}", last_error());
        }
        assert_eq!(try_open(&fixture("bintree/packed"), 3).err(), Some(PmStatus::Argument));
    }

    #[test]
    fn null_and_other_versions_are_refused() {
        let path = c"x".as_ptr();
        // SAFETY: the path ends
        unsafe {
            assert_eq!(pm_open(PM_API_VERSION, path, 0, None), PmStatus::Argument);
            let mut out = std::mem::MaybeUninit::uninit();
            assert_eq!(pm_open(PM_API_VERSION, std::ptr::null(), 0, Some(&mut out)), PmStatus::Argument);
            for version in [0, PM_API_VERSION + 1, PM_API_VERSION + 1000] {
                assert_eq!(pm_open(version, path, 0, Some(&mut out)), PmStatus::Version);
                assert!(out.assume_init_ref().is_none());
            }
            assert_eq!(pm_open(PM_API_VERSION, c"\xff".as_ptr(), 0, Some(&mut out)), PmStatus::Argument);
        }
    }

    #[test]
    fn parents_of_a_binary_tree_are_above_their_children() {
        let dataset = open("bintree/files", PmAxes::ZUp);
        let Content::Bintree(leaves) = &dataset.content else { panic!() };
        for (index, (parent, depth)) in leaves.places.iter().enumerate() {
            assert_eq!(*depth as usize, leaves.tree.path(index as u32).len());
            let children = leaves.tree.children(*parent);
            assert_eq!(children.is_some_and(|c| c.contains(&(index as u32))), index > 0);
        }
    }
}
