//! Which field of a LAS record holds which attribute.

use super::kernels::{Change, Move, Target};
use super::records::{MAX_NAME, cut_name};
use super::strided::StridedColumn;
use crate::scan::las::header::RECORD_LEN;
use crate::scan::las::schema::{Field, FieldKind, Schema};
use crate::{Attribute, AttributeType, Changes, WriteError};

/// Where the values of an attribute are in the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FieldPlace {
    /// In the field of the point format that has its name. Where the type of the attribute holds more than the field, values
    /// that do not fit are counted as they are written.
    Field,
    /// Degrees in the field that has steps of 0.006°: the nearest. Whole degrees come back by rounding; of others those are
    /// counted that are no whole steps.
    AngleField,
    /// In the extra bytes behind the fields, as they are.
    ExtraBytes,
}

/// Which field of a LAS record holds which attribute: the inverse of what the reader hands out.
#[derive(Debug, Clone)]
pub struct RecordLayout {
    point_format: u8,
    record_len: usize,
    extra: Vec<Attribute>,
    /// By attribute.
    places: Vec<FieldPlace>,
    moves: Vec<Move>,
}

/// Fields of which formats 0–5 hold less than the type of their column.
const NARROW: [&str; 4] = ["return number", "number of returns", "classification flags", "classification"];

impl RecordLayout {
    /// The longest record of a LAS file.
    pub const MAX_RECORD: usize = 65_535;

    /// The one of the point formats `allowed` (0–3 and 6–8; others are passed over) in which the most attributes have a field
    /// that holds all their values; of these the shortest. What has no field goes to the extra bytes, unchanged: names are cut
    /// to 32 bytes, attributes of more than three elements become several.
    ///
    /// That returns and classes fit formats 0–3 is believed if there are scan angles in whole degrees, as these have.
    ///
    /// # Errors
    /// No format among those allowed; records of more than [`Self::MAX_RECORD`] bytes.
    pub fn choose(attributes: &[Attribute], allowed: &[u8]) -> Result<Self, WriteError> {
        let known = allowed.iter().copied().filter(|format| matches!(format, 0..=3 | 6..=8));
        let best = known.map(|format| Self::of_format(attributes, format)).min_by_key(|layout| layout.cost(attributes));
        let best =
            best.ok_or_else(|| WriteError::input("no point format that can be written; 0 to 3 and 6 to 8 can"))?;
        if best.record_len > Self::MAX_RECORD {
            let what = format!("points of {} bytes; those of LAS have up to {}", best.record_len, Self::MAX_RECORD);
            return Err(WriteError::input(what));
        }
        Ok(best)
    }

    /// Values that may not fit, attributes that LAS knows and this format has no field for, length, number.
    fn cost(&self, attributes: &[Attribute]) -> (usize, usize, usize, u8) {
        let is_legacy = attributes.iter().any(|a| a.name == "scan angle rank" && a.ty == AttributeType::Int8);
        let is_narrow = |a: &&Attribute| self.point_format < 6 && !is_legacy && NARROW.contains(&a.name.as_str());
        let narrow = attributes.iter().filter(is_narrow).count();
        let misplaced = self.places.iter().filter(|place| **place != FieldPlace::Field).count();
        (narrow, misplaced, self.record_len, self.point_format)
    }

    fn of_format(attributes: &[Attribute], point_format: u8) -> Self {
        let schema = Schema::of_format(point_format);
        let mut out = Self {
            point_format,
            record_len: RECORD_LEN[usize::from(point_format)],
            extra: Vec::new(),
            places: Vec::new(),
            moves: Vec::new(),
        };
        let has = |name: &str| attributes.iter().any(|a| a.name == name);
        for (index, attribute) in attributes.iter().enumerate() {
            let is_free = attribute.name != "scan angle rank" || !has("scan angle");
            match field_move(attribute, &schema).filter(|_| is_free) {
                Some((place, target)) => {
                    out.moves.push(Move { attribute: index, target });
                    out.places.push(place);
                }
                None => out.push_extra(index, attribute),
            }
        }
        let (number, of) = (has("return number"), has("number of returns"));
        if !(number && of) {
            // behind the others: what is missing follows from what is there
            let target = Target::OnlyReturn { is_wide: point_format >= 6, number: !number, of: !of };
            out.moves.push(Move { attribute: usize::MAX, target });
        }
        out
    }

    /// Extra bytes behind those that are there.
    fn push_extra(&mut self, index: usize, attribute: &Attribute) {
        let size = attribute.ty.size();
        self.moves
            .push(Move { attribute: index, target: Target::Copy { at: self.record_len, bytes: attribute.size() } });
        self.places.push(FieldPlace::ExtraBytes);
        self.record_len += size * attribute.elements;
        if attribute.elements <= 3 {
            let name = self.free_name(&attribute.name);
            self.extra.push(Attribute { name, ..attribute.clone() });
            return;
        }
        for element in 0..attribute.elements {
            let name = self.free_name(&format!("{} {element}", cut_name(&attribute.name, MAX_NAME - 6)));
            let mut part = Attribute::new(name, attribute.ty, 1);
            part.description.clone_from(&attribute.description);
            part.scale = attribute.scale.get(element..=element).map_or_else(|| vec![1.0], <[f64]>::to_vec);
            part.offset = attribute.offset.get(element..=element).map_or_else(|| vec![0.0], <[f64]>::to_vec);
            part.no_data = attribute.no_data.as_ref().and_then(|v| v.get(element)).map(|v| vec![*v]);
            self.extra.push(part);
        }
    }

    /// The name in its 32 bytes, with a number if another one has it, or a field of the point format, which is there in any case.
    fn free_name(&self, wanted: &str) -> String {
        let fields = Schema::of_format(self.point_format).attributes;
        let is_free = |name: &str| self.extra.iter().chain(&fields).all(|other| other.name != name);
        let cut = cut_name(wanted, MAX_NAME);
        if is_free(cut) {
            return cut.to_owned();
        }
        let numbered = (2..).map(|i| format!("{} {i}", cut_name(wanted, MAX_NAME - 6)));
        numbered.into_iter().find(|name| is_free(name)).unwrap_or_default()
    }

    /// The point format: 0–3 or 6–8.
    pub fn point_format(&self) -> u8 {
        self.point_format
    }

    /// Bytes of a record, with the extra bytes.
    pub fn record_len(&self) -> usize {
        self.record_len
    }

    /// What the extra bytes behind the fields are, in order.
    pub fn extra_bytes(&self) -> &[Attribute] {
        &self.extra
    }

    /// Where each attribute is, in the order of those chosen for.
    pub fn places(&self) -> &[FieldPlace] {
        &self.places
    }

    /// Encodes as many records as there is room for in `out`, a multiple of [`Self::record_len`]. Values come from `positions`
    /// (x, y and z, steps of the lattice) and `columns`, one for each attribute chosen for, of its type and elements; a column
    /// that is not there is 0. Without return numbers every point is the only return.
    ///
    /// `changes`: one for each attribute, in which values are counted that a field cannot hold; the nearest end is taken for
    /// counts and flags, 0 for what is a name (classes, their flags, scanner channels, point source ids).
    ///
    /// # Panics
    /// Columns with fewer points than `out` has room for.
    pub fn put(
        &self,
        positions: &[StridedColumn<'_>; 3],
        columns: &[Option<StridedColumn<'_>>],
        out: &mut [u8],
        changes: &mut [Changes],
    ) {
        super::kernels::put(&self.moves, self.record_len, positions, columns, out, changes);
    }
}

/// How an attribute gets into its field; `None`: it has none, or one that does not hold its values.
fn field_move(attribute: &Attribute, schema: &Schema) -> Option<(FieldPlace, Target)> {
    let is_plain = attribute.scale.iter().all(|s| *s == 1.0) && attribute.offset.iter().all(|o| *o == 0.0);
    let field = |name: &str| {
        let i = schema.attributes.iter().position(|a| a.name == name)?;
        Some((&schema.attributes[i], schema.fields[i]))
    };
    if !is_plain {
        return None;
    }
    let Some((own, Field { at, kind, .. })) = field(&attribute.name) else {
        let is_rank =
            attribute.name == "scan angle rank" && attribute.ty == AttributeType::Int8 && attribute.elements == 1;
        let (_, Field { at, .. }) = field("scan angle").filter(|_| is_rank)?;
        return Some((FieldPlace::AngleField, Target::Angle { at }));
    };
    if own.elements != attribute.elements {
        return None;
    }
    let is_same = own.ty == attribute.ty;
    if attribute.name == "scan angle" && attribute.ty == AttributeType::Float64 {
        return Some((FieldPlace::AngleField, Target::Degrees { at }));
    }
    let target = match (kind, change(&attribute.name)) {
        (FieldKind::Bits { mask: 0xff, .. }, _) if is_same => Target::Copy { at, bytes: 1 },
        (FieldKind::Bits { shift, mask }, change) if is_same => {
            Target::Bits { at, shift, mask, change: change.unwrap_or(Change::Clamp) }
        }
        (FieldKind::Bits { shift, mask }, Some(change)) => Target::Whole { at, shift, most: u16::from(mask), change },
        (FieldKind::Plain, _) if is_same => Target::Copy { at, bytes: attribute.size() },
        (FieldKind::Plain, Some(change)) if own.ty == AttributeType::UInt16 => {
            Target::Whole { at, shift: 0, most: u16::MAX, change }
        }
        (FieldKind::Plain, None) if own.ty == AttributeType::UInt16 && attribute.ty == AttributeType::UInt8 => {
            (own.elements == 1).then_some(Target::Whole { at, shift: 0, most: u16::MAX, change: Change::Clamp })?
        }
        _ => return None,
    };
    Some((FieldPlace::Field, target))
}

/// What becomes of values that the field of a whole quantity cannot hold; `None` for measured ones, of which nothing may be
/// lost.
fn change(name: &str) -> Option<Change> {
    match name {
        "return number" | "number of returns" | "user data" | "scan direction flag" | "edge of flight line" => {
            Some(Change::Clamp)
        }
        "classification" | "classification flags" | "scanner channel" | "point source id" => Some(Change::LeaveOut),
        _ => None,
    }
}
