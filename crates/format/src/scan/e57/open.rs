//! From the bytes around the points to a scan that can be decoded.

use std::collections::HashSet;
use std::path::Path;

use super::cuts::{self, Cut};
use super::decode::Values;
use super::fields::Field;
use super::file::{E57Scan, ScanPlan};
use super::notes::Notes;
use super::options::E57Options;
use super::packets::Section;
use super::pages::{Pages, logical, logical_len, physical};
use super::pose::Pose;
use super::scaling::{self, Scaling};
use super::schema::{Roles, ScanFields, Schema};
use super::streams::Streams;
use super::xml::{Cloud, Refusal};
use super::{header, images, xml};
use crate::scan::chosen::chosen;
use crate::scan::source::Source;
use crate::{
    Aabb, Advice, AxisGrid, Counted, Crs, Fault, Piece, ReadError, Resolution, ScanInfo, ScanPart, ScanWarning,
};

/// Records of a piece: one batch; a multiple of 8, so that packed values start at a byte border.
const PIECE_RECORDS: u64 = 50_000;
/// Bytes of packed values that a piece has at most, unless eight records have more: they are held while it is decoded.
const PIECE_BYTES: u64 = 4 << 20;
/// Records that a scan may have without a single bit of data (all fields constant).
const MAX_FROM_NOTHING: u64 = 65_536;

/// A scan on the way to a [`ScanPlan`].
struct Draft<'a> {
    index: usize,
    cloud: &'a Cloud,
    fields: Vec<Field>,
    roles: Roles,
    pose: Pose,
    cuts: Vec<Cut>,
}

/// [`super::open_with`].
pub(super) fn open(path: &Path, options: &E57Options) -> Result<E57Scan, ReadError> {
    let source = Source::open(path)?;
    let mut warnings = Vec::new();
    let xml_bytes = header::read_xml(&source, options.max_xml, &mut warnings)?;
    let mut document = xml::parse(&xml_bytes, options.max_xml, &mut warnings).map_err(|refusal| match refusal {
        Refusal::Broken(why) => {
            let what = format!("the XML section cannot be read: {why}");
            ReadError::broken(path, 24, Fault::Header(what)).advise(Advice::ExportAgain)
        }
        Refusal::TooMuch(why) => {
            ReadError::unsupported(path, format!("the XML section describes {why}")).advise(Advice::MoreMemory)
        }
    })?;
    drop(xml_bytes);
    let images = images::describe(&document, &mut warnings);
    let scans_there = document.clouds.len();
    choose(&mut document.clouds, options.scans.as_deref(), &mut warnings);
    let mut notes = Notes::default();
    let mut drafts = drafts(&source, &document.clouds, options, &mut notes)?;
    cut_all(&source, &document.clouds, &mut drafts, &mut notes);
    let scalings: Vec<_> = drafts.iter().map(|draft| scalings(&source, draft, &mut notes)).collect();
    let views: Vec<_> = drafts.iter().zip(&scalings).map(|(draft, s)| draft.view(s)).collect();
    let Schema { attributes, fills } = Schema::new(&views).map_err(|what| ReadError::unsupported(path, what))?;
    if scans_there > usize::from(u16::MAX) + 1 {
        warnings.push(ScanWarning::SourceIdsShared { scans: scans_there });
    }
    warnings.extend(notes.warnings());
    let bounds_declared = bounds(&drafts);
    let resolution = resolution(&source, &drafts);
    let parts = parts(&document.clouds, &drafts);
    let (mut scans, mut cuts) = (Vec::new(), Vec::new());
    for (i, (draft, fills)) in drafts.into_iter().zip(fills).enumerate() {
        let Draft { index, fields, roles, pose, cuts: own, .. } = draft;
        cuts.extend(own.into_iter().map(|cut| Cut { scan: i, ..cut }));
        scans.push(ScanPlan { index, fields, positions: roles.positions, pose, fills });
    }
    let info = ScanInfo {
        path: path.to_path_buf(),
        format: format_name(document.clouds.len(), scans_there),
        points_declared: document.clouds.iter().fold(0, |sum: u64, c| sum.saturating_add(c.records)),
        bounds_declared,
        lattice: None,
        resolution,
        parts,
        images,
        // they are scaled to 16 bits from their limits
        rgb_is_16_bit: true,
        attributes: attributes.into(),
        crs: crs(document.coordinate_metadata.as_deref(), &mut warnings),
        file_bytes: source.len(),
        warnings,
    };
    Ok(E57Scan { source, info, scans, pieces: pieces(&cuts), cuts })
}

impl Draft<'_> {
    fn view<'b>(&'b self, (colour, intensity): &(Option<[Scaling; 3]>, Option<Scaling>)) -> ScanFields<'b> {
        let (colour, intensity) = (*colour, *intensity);
        ScanFields { index: self.index, fields: &self.fields, roles: &self.roles, colour, intensity }
    }
}

/// All scans that declare points.
fn drafts<'a>(
    source: &Source,
    clouds: &'a [Cloud],
    options: &E57Options,
    notes: &mut Notes,
) -> Result<Vec<Draft<'a>>, ReadError> {
    let mut drafts = Vec::new();
    for cloud in clouds {
        let index = cloud.index;
        if !cloud.has_points {
            notes.add(index, ScanWarning::PointsUndescribed);
        }
        if cloud.records == 0 {
            continue;
        }
        let refuse = |what: &str| ReadError::unsupported(source.path(), format!("scan {}: {what}", index + 1));
        let fields = cloud.fields.clone();
        let roles = Roles::new(&fields, index, options, notes).map_err(refuse)?;
        if let Some(what) = roles.positions.misplaced(&fields) {
            let fault = Fault::Header(format!("scan {}: {what}", index + 1));
            return Err(ReadError::broken(source.path(), 24, fault).advise(Advice::ExportAgain));
        }
        if fields.iter().all(|f| f.encoding.bits() == 0) && cloud.records > MAX_FROM_NOTHING {
            return Err(refuse(&format!("{} points without a bit of data", cloud.records)));
        }
        let (pose, note) = Pose::new(cloud.pose);
        note.into_iter().for_each(|note| notes.add(index, note));
        drafts.push(Draft { index, cloud, fields, roles, pose, cuts: Vec::new() });
    }
    Ok(drafts)
}

/// Cuts every scan into pieces.
fn cut_all(source: &Source, clouds: &[Cloud], drafts: &mut [Draft<'_>], notes: &mut Notes) {
    let mut window = Vec::new();
    // heads alone are read: a page at a time
    let mut pages = Pages::new(source, &mut window, 1);
    let mut starts: Vec<u64> = clouds.iter().map(|cloud| logical(cloud.file_offset)).collect();
    starts.sort_unstable();
    let file_end = logical_len(source);
    let mut taken = HashSet::new();
    for draft in drafts {
        let at = logical(draft.cloud.file_offset);
        // no byte belongs to two scans, so that a small file cannot claim many points
        if !taken.insert(at) {
            notes.add(draft.index, ScanWarning::PointsShared);
            continue;
        }
        let next = starts.partition_point(|start| *start <= at);
        let limit = starts.get(next).copied().unwrap_or(file_end).min(file_end);
        let section = Section::read(&mut pages, at, limit);
        let bits: u64 = draft.fields.iter().map(|field| u64::from(field.encoding.bits())).sum();
        let step = ((8 * PIECE_BYTES / bits.max(1)).min(PIECE_RECORDS) / 8 * 8).max(8);
        let found = cuts::cut(&mut pages, section, draft.index, &draft.fields, draft.cloud.records, step);
        draft.cuts = found.cuts;
        if found.missing > 0 {
            let declared = draft.cloud.records;
            let counted = Counted::Scan(found.fault.map(|f| format!("{} at byte {}", f.what, f.byte)));
            let found = declared - found.missing;
            notes.add(draft.index, ScanWarning::PointsMissing { declared, found, counted });
        }
    }
}

/// What colour and intensity of a scan are scaled by.
fn scalings(source: &Source, draft: &Draft<'_>, notes: &mut Notes) -> (Option<[Scaling; 3]>, Option<Scaling>) {
    let Draft { cloud, fields, roles, .. } = draft;
    let mut sampled = |what: &'static str, ids: &[usize]| {
        let is_float = ids.iter().any(|i| fields[*i].range.is_none() && fields[*i].encoding.bits() >= 32);
        let seen = sample(source, draft, ids);
        let (low, high) = scaling::usual(seen, is_float);
        notes.add(draft.index, ScanWarning::NoLimits { what, low, high });
        (low, high)
    };
    let intensity = roles.intensity.map(|i| {
        let declared = cloud.intensity_limits.and_then(|limits| scaling::declared(limits, &fields[i]));
        Scaling::new(declared.or(fields[i].range).unwrap_or_else(|| sampled("intensity", &[i])))
    });
    let colour = roles.colour.map(|ids| {
        let channels = ids.map(|i| &fields[i]);
        let declared = scaling::colours(cloud.colour_limits, channels);
        let common = |range| [range; 3];
        let or_fields = declared.or_else(|| scaling::union(&channels).map(common));
        or_fields.unwrap_or_else(|| common(sampled("colour", &ids))).map(Scaling::new)
    });
    (colour, intensity)
}

/// The least and the largest finite value of some fields in the first, the middle and the last piece that can be read.
fn sample(source: &Source, draft: &Draft<'_>, ids: &[usize]) -> (f64, f64) {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    let mut needed = vec![false; draft.fields.len()];
    ids.iter().for_each(|i| needed[*i] = true);
    let n = draft.cuts.len();
    let mut places = vec![0, n / 2, n.saturating_sub(1)];
    places.dedup();
    let (mut raw, mut bytes) = (Vec::new(), Vec::new());
    for cut in places.into_iter().filter_map(|i| draft.cuts.get(i)).filter(|cut| cut.lost.is_none()) {
        // a damaged piece is reported when it is decoded
        let Ok(streams) = Streams::gather(source, cut, &draft.fields, &needed, &mut raw, &mut bytes) else { continue };
        let values = Values { fields: &draft.fields, streams: &streams, first: 0, n: cut.records as usize };
        for i in ids {
            values.each(*i, |_, v| {
                if v.is_finite() {
                    range = (range.0.min(v), range.1.max(v));
                }
            });
        }
    }
    range
}

fn pieces(cuts: &[Cut]) -> Vec<Piece> {
    let mut first_point = 0;
    let piece = |cut: &Cut| {
        let (byte_offset, end) = (physical(cut.start), physical(cut.end));
        let piece = Piece { first_point, points: cut.records, byte_offset, byte_len: end.saturating_sub(byte_offset) };
        first_point += cut.records;
        piece
    };
    cuts.iter().map(piece).collect()
}

/// How finely all scans store coordinates, per axis.
fn resolution(source: &Source, drafts: &[Draft<'_>]) -> [Resolution; 3] {
    let of_draft = |draft: &Draft<'_>| {
        let farthest = |field: usize| {
            let (min, max) = sample(source, draft, &[field]);
            if min <= max { min.abs().max(max.abs()) } else { 0.0 }
        };
        draft.pose.resolution(draft.roles.positions.resolution(&draft.fields, farthest))
    };
    let all: Vec<_> = drafts.iter().map(of_draft).collect();
    std::array::from_fn(|a| combined(all.iter().map(|r| r[a])))
}

/// The resolution of an axis over all scans.
fn combined(scans: impl Iterator<Item = Resolution>) -> Resolution {
    let (mut grids, mut finest, mut are_grids) = (Vec::new(), f64::INFINITY, true);
    for scan in scans {
        match scan {
            Resolution::Grid(grid) => {
                finest = finest.min(grid.step);
                grids.push(grid);
            }
            Resolution::Step(step) => {
                finest = finest.min(step);
                are_grids = false;
            }
            Resolution::Single | Resolution::Double => return Resolution::Double,
        }
    }
    match AxisGrid::common(&grids).filter(|_| are_grids) {
        Some(grid) => Resolution::Grid(grid),
        None if finest.is_finite() => Resolution::Step(finest),
        None => Resolution::Double,
    }
}

/// The descriptions of all scans, those without points among them.
fn parts(clouds: &[Cloud], drafts: &[Draft<'_>]) -> Vec<ScanPart> {
    let (mut drafts, mut end) = (drafts.iter().peekable(), 0);
    let part = |cloud: &Cloud| {
        let start = end;
        if let Some(draft) = drafts.next_if(|draft| draft.index == cloud.index) {
            end += draft.cuts.iter().map(|cut| cut.records).sum::<u64>();
        }
        let pose = Pose::new(cloud.pose).0;
        let (rotation, translation) = pose.parts();
        ScanPart {
            number: cloud.index + 1,
            name: cloud.name.clone(),
            points: cloud.records,
            range: start..end,
            bounds: pose.bounds_declared(cloud),
            rotation,
            translation,
        }
    };
    clouds.iter().map(part).collect()
}

/// The box of all scans, if each declares one.
fn bounds(drafts: &[Draft<'_>]) -> Option<Aabb> {
    let boxes = drafts.iter().map(|draft| draft.pose.bounds_declared(draft.cloud)).collect::<Option<Vec<_>>>()?;
    boxes.into_iter().reduce(|a, b| a.union(&b))
}

/// `coordinateMetadata` is to be OGC WKT; codes are found in practice, too.
fn crs(text: Option<&str>, warnings: &mut Vec<ScanWarning>) -> Crs {
    let Some(text) = text else { return Crs::default() };
    let code = text.to_ascii_uppercase().strip_prefix("EPSG:").and_then(|code| code.trim().parse().ok());
    if text.contains('[') {
        return Crs { wkt: Some(text.to_owned()), ..Crs::default() };
    }
    if code.is_none() {
        let start: String = text.chars().take(60).collect();
        warnings.push(ScanWarning::CrsUnknown { start });
    }
    Crs { epsg: code, ..Crs::default() }
}

/// Leaves the scans that were chosen.
fn choose(clouds: &mut Vec<Cloud>, choices: Option<&[String]>, warnings: &mut Vec<ScanWarning>) {
    if clouds.is_empty() {
        warnings.push(ScanWarning::NoScans);
        return;
    }
    let names: Vec<&str> = clouds.iter().map(|cloud| cloud.name.as_str()).collect();
    let is_chosen = chosen(choices, &names);
    if !is_chosen.contains(&true) {
        warnings.push(ScanWarning::NoneChosen { scans: clouds.len() });
    }
    clouds.retain(|cloud| is_chosen.get(cloud.index).copied().unwrap_or(false));
}

/// "E57 1.0, 2 of 3 scans".
fn format_name(read: usize, there: usize) -> String {
    let of = if read == there { String::new() } else { format!("{read} of ") };
    format!("E57 1.0, {of}{there} scan{}", if there == 1 { "" } else { "s" })
}
