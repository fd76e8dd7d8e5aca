//! What the user can do about an error or a warning, as data: a command line names its flags, a library call its fields.

use std::fmt;

use pointmill_format::Aabb;

/// What the user can do. `Display` says it in words that name no command line.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Advice {
    /// Choose another output, or allow the existing one to be replaced.
    ReplaceOutput,
    /// Allow at least this many MiB of memory.
    RaiseMemory {
        /// Smallest ceiling that is enough, MiB.
        mib: u64,
    },
    /// Free space where the output is, or choose an output on another disk.
    FreeDisk,
    /// Free space where temporary files are, or use another folder for them.
    FreeTemporaryDisk,
    /// Raise the limit on the size of files, or choose another file system.
    AllowLargerFiles,
    /// Drop duplicates.
    DropDuplicates,
    /// Keep the duplicates, or convert to octrees alone.
    KeepDuplicates,
    /// Keep only the points inside a box that leaves out the far ones.
    CutBounds {
        /// The box, world units; `None`: the user must choose it.
        bounds: Option<Aabb>,
    },
    /// Keep only the points inside this box, drop those outside, or go on with the coarser step.
    CutOutliers {
        /// The box, world units.
        bounds: Aabb,
    },
    /// Skip points without a valid position.
    SkipInvalid,
    /// Skip points exactly at the origin of their scan.
    SkipOriginPoints,
    /// Convert again once nothing writes to the inputs.
    StopWriting,
    /// Use the colour depth that was detected.
    DetectRgbDepth,
    /// State the colour depth.
    SetRgbDepth,
    /// Round channels that viewers show too bright.
    RoundDarkColours,
    /// Reproject to a system in metres or feet.
    Project,
    /// State that commas of a text separate columns.
    CommasSeparate,
    /// Name the coordinate reference system by its EPSG code.
    NameEpsg,
    /// Give the coordinate reference system as a proj4 definition.
    GiveProj4,
    /// Give the coordinate reference system as WKT.
    GiveWkt,
    /// Reproject the inputs, or name one coordinate reference system for all.
    Reproject,
    /// Name the attributes to keep.
    NameAttributes,
    /// Leave out this attribute.
    LeaveOutAttribute,
    /// Put all leaves into one file.
    PackLeaves,
    /// Limit the points of nodes, and drop duplicates that share one place.
    LimitNodes,
    /// Choose a step that is not shorter for the axis.
    CoarserStep {
        /// The shortest, world units.
        least: f64,
    },
    /// Request a coarser precision; `is_by_format`: or make a dataset of another format.
    CoarserPrecision {
        /// True if formats differ in what they keep.
        is_by_format: bool,
    },
    /// Leave out the input whose offset or scale is wrong, or convert the inputs separately.
    ConvertApart,
    /// Move the file away, or choose another output.
    MoveAway,
    /// Choose another output.
    OtherOutput,
    /// Wait until the other run has ended, or choose another output.
    WaitForRun,
    /// Begin the run anew.
    StartAnew,
    /// Choose another folder.
    OtherFolder,
    /// Plan the job first.
    PlanJob,
    /// Plan the job anew.
    PlanAnew,
    /// List the units that there are.
    ListUnits,
    /// Do the units that are left.
    RunUnits,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self {
            Self::RaiseMemory { mib } => return write!(f, "allow {mib} MiB or more"),
            Self::CutBounds { bounds: Some(b) } => {
                return write!(f, "keep only the points from {:?} to {:?} to leave them out", b.min, b.max);
            }
            Self::CoarserStep { least } => return write!(f, "choose a step of at least {least}"),
            Self::CutOutliers { bounds: b } => {
                let (min, max) = (b.min, b.max);
                return write!(f, "keep only the points from {min:?} to {max:?}, drop outliers, or keep them");
            }
            Self::CoarserPrecision { is_by_format: false } => {
                "request a coarser precision, or convert parts of the scene separately"
            }
            Self::CoarserPrecision { is_by_format: true } => {
                "request a coarser precision, or choose a format that keeps integers"
            }
            Self::ReplaceOutput => "choose another output, or allow it to be replaced",
            Self::FreeDisk => "free some space there, or choose an output on another disk",
            Self::FreeTemporaryDisk => "free some space there, or put temporary files elsewhere",
            Self::AllowLargerFiles => "raise the limit on the size of files, or choose another file system",
            Self::DropDuplicates => "drop duplicates",
            Self::KeepDuplicates => "keep duplicates, or convert to octrees",
            Self::CutBounds { bounds: None } => "limit the bounds to leave them out, or correct the input",
            Self::SkipInvalid => "skip invalid points to leave such points out",
            Self::SkipOriginPoints => "skip points at the origin of their scan to leave them out",
            Self::StopWriting => "convert again once nothing writes to the inputs",
            Self::DetectRgbDepth => "let the colour depth be detected",
            Self::SetRgbDepth => "state the colour depth to override this",
            Self::RoundDarkColours => "round dark colours, or state that they have 8 bits",
            Self::Project => "reproject to a system in metres or feet if it is to be looked at",
            Self::CommasSeparate => "say so if they separate columns",
            Self::NameEpsg => "name the EPSG code if viewers need the projection",
            Self::GiveWkt => "give its WKT",
            Self::GiveProj4 => "give a proj4 definition if viewers need the projection",
            Self::Reproject => "reproject the inputs, or name one system for all",
            Self::NameAttributes => "name the attributes to keep",
            Self::LeaveOutAttribute => "leave it out",
            Self::LimitNodes => "limit the points of nodes; points that share one place stay together",
            Self::PackLeaves => "the packed layout puts all leaves into one file",
            Self::ConvertApart => {
                "leave out the input whose offset or scale is wrong, or convert the inputs separately"
            }
            Self::MoveAway => "move it away, or choose another output",
            Self::OtherOutput => "choose another output",
            Self::StartAnew => "begin anew",
            Self::OtherFolder => "choose another folder",
            Self::PlanJob => "plan the job first",
            Self::PlanAnew => "plan the job anew, in another folder",
            Self::ListUnits => "list the units that are ready",
            Self::RunUnits => "do them first",
            Self::WaitForRun => "wait until it has ended, or choose another output",
        };
        f.write_str(words)
    }
}
