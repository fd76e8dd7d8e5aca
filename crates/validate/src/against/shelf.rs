//! Scans that are open, a few at a time, and what is learned of all of them when they are opened first.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pointmill_format::{AttributeType, OpenOptions, ReadError, open_scan};

use super::opened::{Look, Opened};
use super::rules::Rules;

/// Scans that stay open: fewer than any system allows, and enough that threads which read one file after the other open
/// each once.
const KEPT: usize = 64;

/// Consecutive pieces of a scan that a thread decodes, one after the other: two take less time in some formats when one
/// thread decodes them ([`pointmill_format::Scratch::next_piece`]).
pub(super) const PIECES_TOGETHER: u32 = 2;

/// Scans that are open, those that were used last.
pub(super) struct Shelf {
    options: OpenOptions,
    /// With their numbers, the last used at the end.
    kept: Mutex<Vec<(usize, Arc<Opened>)>>,
}

impl Shelf {
    pub(super) fn new(options: &OpenOptions) -> Self {
        Self { options: options.clone(), kept: Mutex::default() }
    }

    /// The scan number `at`, opened unless it is.
    ///
    /// # Errors
    /// It cannot be opened, or is no scan.
    pub(super) fn get(&self, at: usize, path: &Path, rules: &Rules) -> Result<Arc<Opened>, ReadError> {
        if let Some(open) = self.find(at) {
            return Ok(open);
        }
        // not while others wait for the list; two threads may open a file twice
        let open = Arc::new(Opened::new(open_scan(path, &self.options)?, rules));
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let excess = (kept.len() + 1).saturating_sub(KEPT);
        kept.drain(..excess);
        kept.push((at, open.clone()));
        Ok(open)
    }

    fn find(&self, at: usize) -> Option<Arc<Opened>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|(number, _)| *number == at)?;
        let last = kept.len() - 1;
        kept[place..].rotate_left(1);
        Some(kept[last].1.clone())
    }
}

/// What is kept of every scan, however many there are; they are open only while they are read.
pub(crate) struct Source {
    pub(super) path: PathBuf,
    /// Parts that are decoded alone.
    pub(super) pieces: usize,
    /// The file says that its colours have 16 bits.
    pub(crate) declares_16_bit_colour: bool,
}

impl Source {
    pub(super) fn new(path: &Path, pieces: usize, declares_16_bit_colour: bool) -> Self {
        Self { path: path.to_path_buf(), pieces, declares_16_bit_colour }
    }
}

/// What is learned of all scans.
pub(super) struct Gathered {
    pub(super) list: Vec<Source>,
    /// See [`PIECES_TOGETHER`]: the index of a scan, and the first of its pieces that are taken together.
    pub(super) pairs: Vec<(u32, u32)>,
    pub(super) points: u64,
    pub(super) decode_bytes: u64,
    pub(super) may_move: bool,
    /// By attribute of the dataset, the types that fill it.
    pub(super) types: Vec<Vec<AttributeType>>,
    pub(super) names: BTreeSet<String>,
}

impl Gathered {
    /// Puts looks at `paths` together.
    ///
    /// # Errors
    /// The first of them that failed.
    pub(super) fn of(paths: &[PathBuf], looks: Vec<Result<Look, ReadError>>, rules: &Rules) -> Result<Self, ReadError> {
        let mut all = Self {
            list: Vec::new(),
            pairs: Vec::new(),
            points: 0,
            decode_bytes: 0,
            may_move: false,
            types: vec![Vec::new(); rules.attributes.len()],
            names: BTreeSet::new(),
        };
        for (path, look) in paths.iter().zip(looks) {
            let look = look?;
            let at = all.list.len() as u32;
            all.pairs.extend((0..look.pieces as u32).step_by(PIECES_TOGETHER as usize).map(|piece| (at, piece)));
            all.list.push(Source::new(path, look.pieces, look.declares_16_bit_colour));
            all.points = all.points.saturating_add(look.points);
            all.decode_bytes = all.decode_bytes.max(look.decode_bytes);
            all.may_move |= look.may_move;
            for (types, ty) in all.types.iter_mut().zip(look.types) {
                types.extend(ty.filter(|ty| !types.contains(ty)));
            }
            all.names.extend(look.not_in_dataset);
        }
        Ok(all)
    }
}
