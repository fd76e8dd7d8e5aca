//! What stands around the points of a file: header, records, what they say of the points.

use super::compatible;
use super::crs;
use super::header::Header;
use super::laszip::{Arrangement, LaszipFault, LaszipRecord};
use super::records::Records;
use super::schema::Schema;
use crate::scan::source::Source;
use crate::{Advice, Crs, Fault, ReadError, ScanWarning};

/// Everything but where the points are.
pub(super) struct Front {
    pub(super) header: Header,
    pub(super) records: Records,
    pub(super) schema: Schema,
    /// Of compressed points.
    pub(super) laszip: Option<LaszipRecord>,
    pub(super) crs: Crs,
    pub(super) warnings: Vec<ScanWarning>,
}

impl Front {
    /// # Errors
    /// Those of [`super::open`].
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        let mut warnings = Vec::new();
        let mut header = Header::read(source, &mut warnings)?;
        let records = Records::read(source, &header, &mut warnings)?;
        let schema = Schema::new(&header, &records, &mut warnings);
        if schema.compatible.is_some() {
            header.take_point_count(compatible::point_count(&records), &mut warnings);
        }
        let laszip = find_laszip(source, &header, &records, &mut warnings)?;
        // compatibility mode has cleared the bit: the points were of a format that has WKT alone
        let wkt_counts = header.wkt_counts || schema.compatible.is_some();
        let crs = crs::read(&records, wkt_counts, &mut warnings);
        Ok(Self { header, records, schema, laszip, crs, warnings })
    }

    /// For people: "LAZ 1.4, point format 7".
    pub(super) fn format_name(&self) -> String {
        let kind = match (&self.laszip, self.records.find("copc", 1)) {
            (Some(_), Some(_)) => "COPC, LAZ",
            (Some(_), None) => "LAZ",
            (None, _) => "LAS",
        };
        let (Header { version, point_format: stored, .. }, compatible) = (&self.header, self.schema.compatible);
        let points = match compatible.map(|c| c.point_format(*stored)) {
            Some(format) => format!("{format}, stored as {stored} in LASzip's compatibility mode"),
            None => stored.to_string(),
        };
        format!("{kind} {}.{}, point format {points}", version.0, version.1)
    }
}

/// The LASzip record of a compressed file.
///
/// Some tools unpack a LAZ file and keep its record. Such a file lacks the compression bits in its point format and is
/// long enough for plain records.
fn find_laszip(
    source: &Source,
    header: &Header,
    records: &Records,
    warnings: &mut Vec<ScanWarning>,
) -> Result<Option<LaszipRecord>, ReadError> {
    let broken = |offset: u64, what: String| {
        ReadError::broken(source.path(), offset, Fault::Header(what)).advise(Advice::ExportAgain)
    };
    let Some(record) = records.find("laszip encoded", 22204) else {
        let what = "the points are marked as compressed but there is no LASzip record";
        return if header.compressed_bit { Err(broken(104, what.to_owned())) } else { Ok(None) };
    };
    let plain_len = header.point_count.saturating_mul(header.record_len as u64).saturating_add(header.points_start);
    if !header.compressed_bit && plain_len <= source.len() {
        warnings.push(ScanWarning::LaszipIgnored);
        return Ok(None);
    }
    let laszip = LaszipRecord::parse(record, header).map_err(|fault| match fault {
        LaszipFault::Broken(what) => broken(record.data_offset, what),
        LaszipFault::Unknown(what) => ReadError::unsupported(source.path(), what),
    })?;
    Ok((laszip.arrangement != Arrangement::Plain).then_some(laszip))
}
