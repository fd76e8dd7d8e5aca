//! What the records of a file are made of.

use pointmill_format::scan::las::write::{FieldPlace, RecordLayout, StridedColumn};
use pointmill_format::{Attribute, AttributeType, Changes, DatasetKind, Lattice};

use crate::cloud::{Cloud, RecordFrame};
use crate::error::{ConvertError, Unsupported};
use crate::outputs::attributes::{Choice, choose};
use crate::sources::{POSITION_BYTES, Schema};
use crate::warning::{NameFault, RenamedAttribute};

/// The point formats that there are.
const POINT_FORMATS: [u8; 3] = [6, 7, 8];

/// What goes where.
pub(super) struct Content {
    pub(super) choice: Choice,
    pub(super) layout: RecordLayout,
    /// What the stored integers are on.
    pub(super) lattice: Lattice,
    /// The point of the job lattice that is stored as zeros.
    pub(super) anchor: [i64; 3],
    /// Added to a coordinate of a stored record (modulo 2^32) it gives that of the file.
    shift: [u32; 3],
    /// Where the values of an attribute are in a stored record.
    columns: Vec<(usize, AttributeType, usize)>,
    /// Bytes of a stored record.
    pub(super) stored_stride: usize,
    /// Where the GPS time is in a stored record.
    pub(super) time_at: Option<usize>,
}

impl Content {
    /// # Errors
    /// Attributes that a record of LAS has no room for.
    pub(super) fn choose(cloud: &Cloud<'_>) -> Result<Self, ConvertError> {
        let schema = cloud.schema();
        let choice = choose(cloud.plan, schema, &cloud.intake.unread, &cloud.facts.ranges, &[]);
        let kept: Vec<Attribute> = choice.kept.iter().map(|&i| schema.attributes[i].clone()).collect();
        let kind = DatasetKind::Copc;
        let layout = RecordLayout::choose(&kept, &POINT_FORMATS)
            .map_err(|e| Unsupported::Format { kind, what: e.to_string() })?;
        let (job, bounds, frame) = (&cloud.lattice.lattice, &cloud.stats.bounds, &cloud.frame);
        let fits = |q: i64| i32::try_from(q).is_ok();
        // the integers of the sources, where they fit: then coordinates are the same doubles
        let anchor = std::array::from_fn(|a| match bounds.is_empty() || fits(bounds.min[a]) && fits(bounds.max[a]) {
            true => 0,
            false => frame.cube.min[a],
        });
        let corner = frame.cube.offset(job);
        let offset = std::array::from_fn(|a| if anchor[a] == 0 { job.offset[a] } else { corner[a] });
        Ok(Self {
            columns: columns(schema, &choice.kept),
            stored_stride: schema.stride,
            time_at: time_at(schema, &choice.kept),
            lattice: Lattice { scale: job.scale, offset },
            shift: shift(frame, anchor),
            anchor,
            layout,
            choice,
        })
    }

    /// Encodes stored records, whose positions it changes; `changes`: for each attribute that is kept.
    pub(super) fn put(&self, rows: &mut [u8], out: &mut [u8], changes: &mut [Changes]) {
        if self.shift != [0; 3] {
            for row in rows.chunks_exact_mut(self.stored_stride) {
                for (axis, shift) in row[..POSITION_BYTES].as_chunks_mut::<4>().0.iter_mut().zip(self.shift) {
                    *axis = u32::from_le_bytes(*axis).wrapping_add(shift).to_le_bytes();
                }
            }
        }
        let rows = &*rows;
        let positions = [0, 4, 8].map(|at| StridedColumn::new(rows, at, self.stored_stride, AttributeType::Int32, 1));
        let column = |(at, ty, elements): &(usize, AttributeType, usize)| {
            Some(StridedColumn::new(rows, *at, self.stored_stride, *ty, *elements))
        };
        let columns: Vec<_> = self.columns.iter().map(column).collect();
        self.layout.put(&positions, &columns, out, changes);
    }

    /// What readers of the file call the attributes that are in it as they are: the other fields of a record are filled up.
    /// `changes`: values that a field could not hold, by attribute that is kept.
    pub(super) fn written(&self, schema: &Schema, changes: &[Changes]) -> Vec<String> {
        let is_changed = |i: usize| changes.get(i).is_some_and(|changes| !changes.is_empty());
        let mut extra = self.layout.extra_bytes().iter();
        let name = |(n, (&i, place)): (usize, (&usize, &FieldPlace))| {
            let Attribute { name, elements, .. } = &schema.attributes[i];
            match place {
                FieldPlace::Field | FieldPlace::AngleField if is_changed(n) => None,
                FieldPlace::Field => Some(name.clone()),
                FieldPlace::AngleField => Some("scan angle".to_owned()),
                _ if *elements > 3 => {
                    extra.by_ref().take(*elements).for_each(drop);
                    None
                }
                _ => extra.next().map(|a| a.name.clone()),
            }
        };
        self.choice.kept.iter().zip(self.layout.places()).enumerate().filter_map(name).collect()
    }

    /// Attributes that are called otherwise in the file, or are several there.
    pub(super) fn renamed(&self, schema: &Schema) -> Vec<RenamedAttribute> {
        let mut extra = self.layout.extra_bytes().iter();
        let kept = self.choice.kept.iter().zip(self.layout.places());
        let outside = kept.filter(|(_, place)| **place == FieldPlace::ExtraBytes);
        let mut renamed = Vec::new();
        for (&i, _) in outside {
            let Attribute { name, elements, .. } = &schema.attributes[i];
            let parts = if *elements > 3 { *elements } else { 1 };
            let stored: Vec<&str> = extra.by_ref().take(parts).map(|a| a.name.as_str()).collect();
            let stored = stored.join(", ");
            if stored != *name {
                renamed.push(RenamedAttribute::new(name.clone(), stored, NameFault::ExtraBytes));
            }
        }
        renamed
    }
}

/// Where the GPS time is that goes to its field.
fn time_at(schema: &Schema, kept: &[usize]) -> Option<usize> {
    let is_time = |a: &Attribute| a.name == "gps-time" && a.ty == AttributeType::Float64 && a.elements == 1;
    kept.iter().find(|&&i| is_time(&schema.attributes[i])).map(|&i| schema.offsets[i])
}

fn columns(schema: &Schema, kept: &[usize]) -> Vec<(usize, AttributeType, usize)> {
    let of = |&i: &usize| (schema.offsets[i], schema.attributes[i].ty, schema.attributes[i].elements);
    kept.iter().map(of).collect()
}

fn shift(frame: &RecordFrame, anchor: [i64; 3]) -> [u32; 3] {
    std::array::from_fn(|a| (frame.origin.0[a] - anchor[a]) as u32)
}
