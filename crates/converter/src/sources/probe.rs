//! Headers of all inputs, on all threads. What is found does not depend on which of them comes first.

use std::path::Path;
use std::sync::{Arc, Mutex};

use pointmill_format::{Advice, Attribute, ErrorKind, ReadError, Scan, Wanted};

use super::open_scans::OpenScans;
use super::same;
use super::shared::Shared;
use super::source::{Source, Stored};
use super::survey::Survey;
use crate::error::ConvertError;
use crate::plan::OnFault;
use crate::runtime::Workers;
use crate::warning::{Warning, reason_of};

/// What the header of an input says.
pub(super) struct Probed {
    pub(super) source: Source,
    pub(super) attributes: Arc<[Attribute]>,
    /// Points in its pieces.
    pub(super) points: u64,
    /// Points declared but not there.
    pub(super) points_missing: u64,
    pub(super) warnings: Vec<Warning>,
    /// If it stays open.
    pub(super) scan: Option<Arc<dyn Scan>>,
}

/// An input that was looked at.
pub(super) enum Outcome {
    Open(Box<Probed>),
    Skipped(Box<Warning>),
}

/// Looks at inputs.
pub(super) struct Probe<'a> {
    pub(super) open: &'a OpenScans,
    pub(super) unreadable: OnFault,
    pub(super) shared: Mutex<Shared>,
}

impl Probe<'_> {
    /// Some inputs, in the order of `paths`; `first`: the index of the first among all.
    ///
    /// # Errors
    /// Of the first input that cannot be read, if the policy says so; the run was asked to stop.
    pub(super) fn some(
        &self,
        first: usize,
        paths: &[&Path],
        workers: &Workers<'_>,
    ) -> Result<Vec<Outcome>, ConvertError> {
        let parts = workers.in_parallel(
            paths.len(),
            Vec::new,
            |found: &mut Vec<(usize, Outcome)>, index| {
                found.push((index, self.one(first + index, paths[index], workers)?));
                workers.advance(1);
                Ok(())
            },
            |found| found,
        )?;
        let mut all: Vec<(usize, Outcome)> = parts.into_iter().flatten().collect();
        all.sort_unstable_by_key(|(index, _)| *index);
        Ok(all.into_iter().map(|(_, outcome)| outcome).collect())
    }

    fn one(&self, index: usize, path: &Path, workers: &Workers<'_>) -> Result<Outcome, ConvertError> {
        let opened = self.open.opener().open(path);
        match opened.and_then(|scan| Ok((missing_points(&*scan, self.unreadable)?, scan))) {
            Ok((missing, scan)) => {
                let mut probed = self.describe(path, &*scan, workers)?;
                probed.points_missing = missing;
                probed.scan = (index < self.open.most()).then(|| scan.into());
                Ok(Outcome::Open(Box::new(probed)))
            }
            Err(error) if self.unreadable == OnFault::Skip && !matches!(error.kind(), ErrorKind::Unsupported) => {
                let warning = Warning::InputSkipped { path: path.to_path_buf(), error: reason_of(&error) };
                Ok(Outcome::Skipped(Box::new(warning)))
            }
            Err(error) => Err(error.into()),
        }
    }

    fn describe(&self, path: &Path, scan: &dyn Scan, workers: &Workers<'_>) -> Result<Probed, ConvertError> {
        let info = scan.info();
        let mark = same::mark(scan);
        let Survey { extent, fineness } = Survey::of(scan, &|| workers.check_stop().is_err());
        let mut shared = self.shared.lock().map_err(|_| failed())?;
        let pieces = u32::try_from(scan.pieces().len());
        let source = Source {
            path: path.into(),
            format: shared.format(&info.format),
            crs: shared.crs(&info.crs),
            stored: shared.stored(&Stored { lattice: info.lattice, resolution: info.resolution, fineness }),
            layout: 0,
            points_declared: info.points_declared,
            bounds_declared: info.bounds_declared,
            extent,
            origins: info.parts.iter().map(|part| part.translation).collect(),
            rgb_is_16_bit: info.rgb_is_16_bit,
            file_bytes: info.file_bytes,
            decode_bytes: scan.decode_bytes(&Wanted::all(info)),
            pieces: pieces.map_err(|_| ReadError::unsupported(path, "more than 4,294,967,295 pieces"))?,
            first_pair: 0,
            mark,
        };
        let warn = |warning: &pointmill_format::ScanWarning| {
            let (path, warning) = (path.to_path_buf(), warning.clone());
            Warning::Scan { path, warning }
        };
        Ok(Probed {
            source,
            attributes: shared.attributes(info),
            points: scan.pieces().iter().map(|p| p.points).sum(),
            points_missing: 0,
            warnings: info.warnings.iter().map(warn).collect(),
            scan: None,
        })
    }
}

/// Points that the header declares and the file does not hold; an error if the policy says so.
fn missing_points(scan: &dyn Scan, policy: OnFault) -> Result<u64, ReadError> {
    let info = scan.info();
    let found: u64 = scan.pieces().iter().map(|p| p.points).sum();
    let missing = info.points_declared.saturating_sub(found);
    if missing > 0 && policy == OnFault::Fail {
        let fault = pointmill_format::Fault::PointsMissing { declared: info.points_declared, found };
        return Err(ReadError::broken(&info.path, info.file_bytes, fault).advise(Advice::SkipUnreadable));
    }
    Ok(missing)
}

fn failed() -> ConvertError {
    ConvertError::Internal("a thread failed while it looked at the inputs".into())
}
