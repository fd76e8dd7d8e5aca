//! Extra Bytes records: LASF_Spec 4, one descriptor of 192 bytes per attribute (LAS 1.4 R15 §2.6, table 24).
//!
//! The specification knows one such record. In the field there are several: each program that adds attributes appends
//! its own, or a new one for all attributes behind the old one. What they describe can be told from the widths: a point
//! has a known number of extra bytes.

use super::bytes::{f64_at, i64_at, text, u64_at};
use super::header::Header;
use super::records::Records;
use crate::{Attribute, AttributeType, ScanWarning};

const DESCRIPTOR: usize = 192;

/// Of more records, all are joined without looking for the ones that fit.
const MAX_CHOICE: usize = 10;

/// A documented attribute behind the standard fields.
#[derive(Debug)]
pub(super) struct ExtraBytes {
    /// Named as the file names it: perhaps empty, perhaps not unique.
    pub(super) attribute: Attribute,
    /// Bytes from the start of the record.
    pub(super) at: usize,
}

impl ExtraBytes {
    /// The attributes that fit the record; whatever remains undocumented becomes a line in `warnings`.
    pub(super) fn read_all(header: &Header, records: &Records, warnings: &mut Vec<ScanWarning>) -> Vec<Self> {
        let mut at = header.format_len();
        let mut found = Vec::new();
        for descriptor in descriptors(records, header.record_len - at, warnings) {
            let name = text(&descriptor[4..36]);
            let Some(len) = byte_len(descriptor).filter(|len| at + len <= header.record_len) else {
                let (data_type, record_len) = (descriptor[2], header.record_len);
                warnings.push(ScanWarning::ExtraBytesOutside { name, data_type, record_len });
                break;
            };
            match attribute(name, descriptor, warnings) {
                Some(attribute) => found.push(Self { attribute, at }),
                None => warnings.push(ScanWarning::ExtraBytesUntyped { bytes: len, at }),
            }
            at += len;
        }
        if at < header.record_len {
            warnings.push(ScanWarning::ExtraBytesUndocumented { bytes: header.record_len - at });
        }
        found
    }
}

/// The descriptors of the records that describe the points, in order. `extra`: bytes of a point to describe.
fn descriptors<'a>(records: &'a Records, extra: usize, warnings: &mut Vec<ScanWarning>) -> Vec<&'a [u8]> {
    let all: Vec<&[u8]> = records.kept.iter().filter(|r| r.is("LASF_Spec", 4)).map(|r| &r.data[..]).collect();
    for data in all.iter().filter(|data| !data.len().is_multiple_of(DESCRIPTOR)) {
        warnings.push(ScanWarning::ExtraBytesLength { bytes: data.len(), descriptor: DESCRIPTOR });
    }
    let all: Vec<Table<'a>> = all.into_iter().filter(|data| data.len() >= DESCRIPTOR).map(Table::new).collect();
    let taken = choose(&all, extra);
    if all.len() > 1 {
        let numbers = taken.iter().map(|i| i + 1).collect();
        let widths = all.iter().map(|table| table.width).collect();
        warnings.push(ScanWarning::ExtraBytesRecords { widths, taken: numbers, extra });
    }
    taken.into_iter().flat_map(|i| all[i].descriptors.iter().copied()).collect()
}

/// One Extra Bytes record.
struct Table<'a> {
    descriptors: Vec<&'a [u8]>,
    /// Bytes of a point that it describes; beyond all records if one of its types does not exist.
    width: usize,
}

impl<'a> Table<'a> {
    fn new(data: &'a [u8]) -> Self {
        let descriptors: Vec<&[u8]> = data.chunks_exact(DESCRIPTOR).collect();
        let widths = descriptors.iter().map(|d| byte_len(d));
        let width = widths.sum::<Option<usize>>().unwrap_or(usize::from(u16::MAX) + 1);
        Self { descriptors, width }
    }

    /// Type, name, scale and offset of each attribute: not its range or description, which programs update.
    fn layout(&self) -> Vec<(u8, u8, String, &'a [u8])> {
        const NO_DATA_SCALE_OFFSET: u8 = 0b1_1001;
        // without a type, the options are a length
        let options = |d: &[u8]| if d[2] == 0 { d[3] } else { d[3] & NO_DATA_SCALE_OFFSET };
        self.descriptors.iter().map(|d| (d[2], options(d), text(&d[4..36]), &d[112..160])).collect()
    }

    fn names(&self) -> impl Iterator<Item = String> {
        self.descriptors.iter().map(|d| text(&d[4..36]))
    }
}

/// Indices of the records to join, in order.
///
/// The same record again counts once. Of the rest, those are taken whose widths add up to `extra`; if there are several
/// such choices, or none, the one that repeats no name, describes the most bytes in the most records, and is the latest.
fn choose(all: &[Table<'_>], extra: usize) -> Vec<usize> {
    let is_first = |i: &usize| all[..*i].iter().all(|earlier| earlier.layout() != all[*i].layout());
    let distinct: Vec<usize> = (0..all.len()).filter(is_first).collect();
    if distinct.len() > MAX_CHOICE {
        return distinct;
    }
    let every: Vec<usize> = (0..all.len()).collect();
    let width = |choice: &[usize]| choice.iter().map(|i| all[*i].width).sum::<usize>();
    let members = |bits: usize| (0..distinct.len()).filter(move |i| bits >> i & 1 == 1);
    let choices = (1..1usize << distinct.len()).map(|bits| members(bits).map(|i| distinct[i]).collect::<Vec<_>>());
    let best = choices
        .filter(|choice| width(choice) <= extra)
        .max_by_key(|choice| (width(choice) == extra, !repeats_a_name(all, choice), width(choice), choice.len()));
    match best {
        Some(best) if width(&best) == extra => best,
        // two attributes that are described alike
        _ if width(&every) == extra => every,
        Some(best) => best,
        // a single one that is too wide describes its first attributes
        None => distinct.into_iter().take(1).collect(),
    }
}

fn repeats_a_name(all: &[Table<'_>], choice: &[usize]) -> bool {
    let mut names: Vec<String> = choice.iter().flat_map(|i| all[*i].names()).collect();
    let there = names.len();
    names.sort_unstable();
    names.dedup();
    names.len() < there
}

/// Bytes a point: `None` for a type that does not exist.
fn byte_len(descriptor: &[u8]) -> Option<usize> {
    match descriptor[2] {
        // no type: the options byte holds the length
        0 => Some(usize::from(descriptor[3])),
        data_type => scalar_type(data_type).map(|(ty, elements)| ty.size() * elements),
    }
}

/// Types 1–10 are scalars; 11–20 and 21–30, deprecated since LAS 1.4 R14, are pairs and triples of the same.
fn scalar_type(data_type: u8) -> Option<(AttributeType, usize)> {
    let ty = match data_type.checked_sub(1)? % 10 {
        0 => AttributeType::UInt8,
        1 => AttributeType::Int8,
        2 => AttributeType::UInt16,
        3 => AttributeType::Int16,
        4 => AttributeType::UInt32,
        5 => AttributeType::Int32,
        6 => AttributeType::UInt64,
        7 => AttributeType::Int64,
        8 => AttributeType::Float32,
        _ => AttributeType::Float64,
    };
    (data_type <= 30).then_some((ty, usize::from((data_type - 1) / 10) + 1))
}

fn attribute(name: String, descriptor: &[u8], warnings: &mut Vec<ScanWarning>) -> Option<Attribute> {
    let (ty, elements) = scalar_type(descriptor[2])?;
    let has = |bit: u8| descriptor[3] >> bit & 1 == 1;
    let doubles = |at: usize| (0..elements).map(|e| f64_at(descriptor, at + 8 * e)).collect::<Vec<_>>();
    let mut out = Attribute::new(name, ty, elements);
    out.description = text(&descriptor[160..192]);
    if has(0) {
        out.no_data = Some((0..elements).map(|e| any_type(ty, descriptor, 40 + 8 * e)).collect());
    }
    if has(3) {
        let scale = doubles(112);
        if scale.iter().all(|s| s.is_normal()) {
            out.scale = scale;
        } else {
            warnings.push(ScanWarning::ExtraBytesScale { name: out.name.clone(), scale });
        }
    }
    if has(4) {
        let offset = doubles(136);
        if offset.iter().all(|o| o.is_finite()) {
            out.offset = offset;
        } else {
            warnings.push(ScanWarning::ExtraBytesOffset { name: out.name.clone(), offset });
        }
    }
    Some(out)
}

/// An 8-byte field that holds a value of `ty`'s family: unsigned, signed or double.
fn any_type(ty: AttributeType, bytes: &[u8], at: usize) -> f64 {
    use AttributeType as T;
    match ty {
        T::UInt8 | T::UInt16 | T::UInt32 | T::UInt64 => u64_at(bytes, at) as f64,
        T::Int8 | T::Int16 | T::Int32 | T::Int64 => i64_at(bytes, at) as f64,
        T::Float32 | T::Float64 => f64_at(bytes, at),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn descriptor(data_type: u8, options: u8, name: &[u8]) -> Vec<u8> {
        let mut d = vec![0; DESCRIPTOR];
        d[2] = data_type;
        d[3] = options;
        d[4..4 + name.len()].copy_from_slice(name);
        d
    }

    #[test]
    fn array_types_have_two_and_three_elements() {
        assert_eq!(scalar_type(1), Some((AttributeType::UInt8, 1)));
        assert_eq!(scalar_type(14), Some((AttributeType::Int16, 2)));
        assert_eq!(scalar_type(30), Some((AttributeType::Float64, 3)));
        assert_eq!(scalar_type(31), None);
        assert_eq!(byte_len(&descriptor(23, 0, b"")), Some(6));
        assert_eq!(byte_len(&descriptor(0, 7, b"")), Some(7));
    }

    /// Which of records of these types are taken for points of `extra` bytes; one name per character.
    fn chosen(records: &[&[(u8, &str)]], extra: usize) -> Vec<usize> {
        let table = |record: &&[(u8, &str)]| -> Vec<u8> {
            record.iter().flat_map(|(ty, name)| descriptor(*ty, 0, name.as_bytes())).collect()
        };
        let data: Vec<Vec<u8>> = records.iter().map(table).collect();
        choose(&data.iter().map(|d| Table::new(d)).collect::<Vec<_>>(), extra)
    }

    #[test]
    fn records_are_joined_where_their_widths_add_up() {
        let (a, b, c): (&[_], &[_], &[_]) = (&[(3, "a"), (4, "b")], &[(1, "c")], &[(9, "d"), (5, "e")]);
        assert_eq!(chosen(&[a, b, c], 13), [0, 1, 2]);
        assert_eq!(chosen(&[a, a, b], 5), [0, 2], "the same record counts once");
        assert_eq!(chosen(&[b, b], 2), [0, 1], "unless there are bytes for both");
        assert_eq!(chosen(&[a, b, c], 12), [0, 2], "those that fit");
        assert_eq!(chosen(&[a], 100), [0]);
        assert_eq!(chosen(&[], 4), [0; 0]);
    }

    #[test]
    fn a_new_record_for_all_attributes_takes_the_place_of_older_ones() {
        let (old, new): (&[_], &[_]) = (&[(3, "a"), (4, "b")], &[(3, "a"), (4, "b"), (1, "c")]);
        assert_eq!(chosen(&[old, new], 5), [1]);
        assert_eq!(chosen(&[new, old], 5), [0]);
        // nothing adds up: no name twice, as much as fits
        assert_eq!(chosen(&[old, new], 8), [1]);
        assert_eq!(chosen(&[old, new], 4), [0]);
        assert_eq!(chosen(&[old, new], 3), [0], "its first attributes");
        let renamed: &[_] = &[(3, "x"), (4, "y")];
        assert_eq!(chosen(&[old, renamed], 4), [1], "the latest of two that fit");
        let broken: &[_] = &[(99, "q")];
        assert_eq!(chosen(&[broken, old], 4), [1]);
    }

    #[test]
    fn a_range_that_was_updated_makes_no_other_record() {
        let old = descriptor(3, 0, b"a");
        let mut new = old.clone();
        new[64..72].fill(7);
        new[160..163].copy_from_slice(b"new");
        assert_eq!(choose(&[Table::new(&old), Table::new(&new)], 2), [0]);
    }

    #[test]
    fn many_records_are_joined_without_a_search() {
        let many: Vec<Vec<u8>> = (0..40).map(|i| descriptor(1, 0, format!("n{i}").as_bytes())).collect();
        assert_eq!(choose(&many.iter().map(|d| Table::new(d)).collect::<Vec<_>>(), 7).len(), 40);
    }

    #[test]
    fn no_data_is_read_in_the_family_of_the_type() {
        let mut d = descriptor(4, 1, b"depth");
        d[40..48].copy_from_slice(&(-9999i64).to_le_bytes());
        let a = attribute("depth".to_owned(), &d, &mut Vec::new()).unwrap();
        assert_eq!(a.no_data, Some(vec![-9999.0]));
    }

    #[test]
    fn a_scale_that_means_nothing_is_replaced_and_told() {
        for scale in [0.0, 5e-310, f64::NAN, f64::INFINITY] {
            let mut warnings = Vec::new();
            let mut d = descriptor(5, 1 << 3, b"a");
            d[112..120].copy_from_slice(&scale.to_le_bytes());
            let a = attribute("a".to_owned(), &d, &mut warnings).unwrap();
            assert_eq!((a.scale, warnings.len()), (vec![1.0], 1), "{scale}");
        }
    }
}
