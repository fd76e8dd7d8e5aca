//! A dataset is made in a hidden folder beside its final name (or in the output, where that is a mounted folder), synced,
//! and given its name at once: finished or not there. What stood there before is there until that moment.

mod dataset;
mod file;
mod files;
mod hidden;
mod leftovers;
mod nodes;
mod ours;
mod place;
mod replace;
mod room;
mod work;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill_format::DatasetKind;
use serde::Serialize;

use crate::error::ConvertError;
use crate::job::KEPT_OUTPUT;
use crate::runtime::disk::{create_folder, sync_folder};
use crate::runtime::{Disk, Events, Replacing};
use crate::warning::Warning;
pub(crate) use dataset::{OutputFile, StagedDataset};
pub(crate) use file::StagedFile;
pub use files::StagedFiles;
use hidden::HiddenFolder;
pub(crate) use ours::REPORT_FILE;
use ours::Standing;
use place::parent_of;
pub use place::resolve_path;
use replace::Replace;
use room::Place;
pub use work::WorkFolder;

/// A folder that becomes the output when all is well, and vanishes when not.
pub(crate) struct StagedFolder {
    hidden: HiddenFolder,
    replacing: Replacing,
    place: Place,
    disk: Arc<dyn Disk>,
    /// What there is to say of earlier runs.
    pub(crate) warnings: Vec<Warning>,
}

impl StagedFolder {
    /// Settles what earlier runs have left, checks that `output` may be made, and makes the hidden folder.
    pub(crate) fn new(
        output: &Path,
        overwrite: bool,
        disk: Arc<dyn Disk>,
        events: &dyn Events,
    ) -> Result<Self, ConvertError> {
        let path = resolve_path(output).map_err(|e| ConvertError::io(output, "finding the place of the output", e))?;
        let warnings = leftovers::settle(&path, events)?;
        let place = Place { given: output.to_path_buf(), path, overwrite };
        let standing = place.check(None)?;
        let (hidden, replacing) = place.make_room(&standing, &*disk)?;
        Ok(Self { hidden, replacing, place, disk, warnings })
    }

    /// The folder on whose file system the output is made.
    pub(crate) fn parent(&self) -> PathBuf {
        parent_of(self.hidden.path()).to_path_buf()
    }

    /// The place of the output, all links followed.
    pub(crate) fn output(&self) -> &Path {
        &self.place.path
    }

    /// The hidden folder.
    pub(crate) fn path(&self) -> &Path {
        self.hidden.path()
    }

    /// The folder that becomes the output.
    pub(crate) fn path_of_new(&self) -> PathBuf {
        self.hidden.path_of_new()
    }

    /// The place of a dataset: the folder itself if it is the only one, else a folder in it. `kept_in`: the folder of a job that
    /// keeps its large files.
    pub(crate) fn dataset(
        &self,
        kind: DatasetKind,
        is_only_one: bool,
        kept_in: Option<&Path>,
    ) -> Result<StagedDataset, ConvertError> {
        let mut dataset = self.whole();
        dataset.kept_as = kept_in.map(|folder| folder.join(format!("{KEPT_OUTPUT}{}-", kind.name())));
        if !is_only_one {
            dataset.name = kind.name();
            dataset.folder.push(dataset.name);
            dataset.shown.push(dataset.name);
            create_folder(&*self.disk, &dataset.folder)
                .map_err(|e| ConvertError::io(&dataset.shown, "making the folder of a dataset", e))?;
        }
        Ok(dataset)
    }

    /// Writes and syncs the report beside the datasets, or in the one that there is.
    pub(crate) fn write_report(&self, report: &impl Serialize) -> Result<(), ConvertError> {
        self.whole().write_json(REPORT_FILE, report)
    }

    fn whole(&self) -> StagedDataset {
        let (folder, shown) = (self.hidden.path_of_new(), self.place.given.clone());
        StagedDataset { folder, shown, name: "", disk: Arc::clone(&self.disk), kept_as: None }
    }

    /// Gives the folder its final name; whatever fails before it has it is undone. What stood there goes afterwards.
    /// Returns what there is to say of that.
    pub(crate) fn finish(mut self, events: &dyn Events) -> Result<Option<Warning>, ConvertError> {
        let output = self.place.path.as_path();
        let mut standing = self.place.check(Some(self.hidden.path()))?;
        let new = self.hidden.path_of_new();
        sync_folder(&*self.disk, &new).map_err(|e| ConvertError::io(output, "syncing the output", e))?;
        if matches!(standing, Standing::Nothing) {
            if (Replace { hidden: &mut self.hidden, output, disk: &*self.disk }).appear()? {
                self.hidden.keep_parents();
                return Ok(leftovers::clear(self.hidden, events));
            }
            standing = self.place.check(Some(self.hidden.path()))?; // an error, or something that may be replaced
        }
        let replace = Replace { hidden: &mut self.hidden, output, disk: &*self.disk };
        match (standing, self.replacing) {
            (Standing::Ours(files), Replacing::EntryByEntry) => {
                replace.will_hold_old()?;
                replace.entries(&names_directly_in(output, &files))?;
            }
            (_, Replacing::EntryByEntry) => replace.entries(&[])?,
            (_, replacing) => replace.whole(replacing)?,
        }
        self.hidden.keep_parents();
        Ok(leftovers::clear(self.hidden, events))
    }
}

fn names_directly_in(folder: &Path, files: &[PathBuf]) -> Vec<String> {
    let names = files.iter().filter(|file| file.parent() == Some(folder)).filter_map(|file| file.file_name());
    names.filter_map(|name| name.to_str()).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests;
