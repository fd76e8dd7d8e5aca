//! The union of the attributes of all scans: which of them are the same quantity, and the type that holds it.

use std::collections::HashMap;
use std::sync::Arc;

use pointmill_format::{Attribute, AttributeType};

use super::recast::{Linear, Recast, common_type};
use super::schema::Schema;
use crate::warning::Warning;

/// Attribute order: `rgb` right after the position (a Unity loader finds it only there), then the order of LAS.
const USUAL_ORDER: [&str; 15] = [
    "rgb",
    "intensity",
    "return number",
    "number of returns",
    "classification flags",
    "scanner channel",
    "scan direction flag",
    "edge of flight line",
    "classification",
    "scan angle rank",
    "user data",
    "scan angle",
    "point source id",
    "gps-time",
    "nir",
];

/// Components of a normal are single precision with the scale 1: viewers know nothing else.
const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

/// Degrees of a step of the scan angle in LAS formats 6–10.
const SCAN_ANGLE_STEP: f64 = 0.006;

/// The attributes of all scans, and where those of each scan go.
#[derive(Debug)]
pub(crate) struct Union {
    pub(crate) schema: Schema,
    /// The columns of scans, once for those that have the same.
    pub(crate) layouts: Vec<Layout>,
    /// By scan: index of its layout.
    pub(crate) layout_of: Vec<u32>,
    /// Attributes of one name that cannot be one.
    pub(crate) warnings: Vec<Warning>,
}

/// The columns of a scan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    /// As the scan has them.
    pub(crate) attributes: Arc<[Attribute]>,
    /// Where each of them goes.
    pub(crate) columns: Vec<Placed>,
}

/// Where a column goes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Placed {
    /// Index in the schema.
    pub(crate) attribute: usize,
    /// `None`: as it was read.
    pub(crate) recast: Option<Recast>,
}

impl Union {
    /// Attributes are the same if they mean the same quantity and have the same number of elements. Where type, scale or
    /// unit differ, the attribute gets a type that holds the values of all. The result depends on the order of `scans`
    /// alone. Lists that scans share are looked at about once.
    pub(crate) fn of<'a>(scans: impl IntoIterator<Item = &'a Arc<[Attribute]>>) -> Self {
        let mut entries: Vec<Entry> = Vec::new();
        let mut drafts: Vec<Draft> = Vec::new();
        let mut latest: HashMap<*const Attribute, usize> = HashMap::new();
        let mut layout_of = Vec::new();
        for attributes in scans {
            let known = latest.get(&attributes.as_ptr()).copied().filter(|draft| drafts[*draft].is_of(attributes));
            let layout = match known {
                Some(draft) if drafts[draft].settled_with == Some(entries.len()) => draft,
                _ => {
                    let draft = Draft::join(attributes, &mut entries);
                    match known.filter(|known| drafts[*known].places == draft.places) {
                        Some(known) => {
                            drafts[known].settled_with = draft.settled_with;
                            known
                        }
                        None => {
                            drafts.push(draft);
                            drafts.len() - 1
                        }
                    }
                }
            };
            latest.insert(attributes.as_ptr(), layout);
            layout_of.push(layout as u32);
        }
        let rank = |e: &Entry| USUAL_ORDER.iter().position(|n| *n == e.name).unwrap_or(USUAL_ORDER.len());
        let mut order: Vec<usize> = (0..entries.len()).collect();
        order.sort_by_key(|&i| (rank(&entries[i]), i));
        let mut places = vec![0; entries.len()];
        order.iter().enumerate().for_each(|(new, &old)| places[old] = new);
        let placed = |(entry, attribute): (&usize, &Attribute)| Placed {
            attribute: places[*entry],
            recast: Form::of(attribute).recast(&entries[*entry].form),
        };
        let layout = |Draft { attributes, places, .. }: &Draft| {
            let columns = places.iter().zip(&**attributes).map(placed).collect();
            Layout { attributes: Arc::clone(attributes), columns }
        };
        let layouts = drafts.iter().map(layout).collect();
        let warnings = entries.iter().filter_map(|e| e.apart.clone()).collect();
        let schema = Schema::new(order.iter().map(|&i| entries[i].attribute()).collect());
        Self { schema, layouts, layout_of, warnings }
    }
}

/// A list of attributes while the union is put together.
struct Draft {
    attributes: Arc<[Attribute]>,
    /// By column: index in the entries.
    places: Vec<usize>,
    /// So many entries were there before the list joined them, and none more afterwards: as long as this is so, the same
    /// list goes to the same places and changes nothing.
    settled_with: Option<usize>,
}

impl Draft {
    /// Adds a list to the union.
    fn join(attributes: &Arc<[Attribute]>, entries: &mut Vec<Entry>) -> Self {
        let before = entries.len();
        let mut places = Vec::with_capacity(attributes.len());
        for attribute in attributes.iter() {
            let place = join(entries, &Form::of(attribute), attribute, &places);
            places.push(place);
        }
        let settled_with = (entries.len() == before).then_some(before);
        Self { attributes: Arc::clone(attributes), places, settled_with }
    }

    fn is_of(&self, attributes: &Arc<[Attribute]>) -> bool {
        Arc::ptr_eq(&self.attributes, attributes)
    }
}

/// An attribute of the union while it is put together.
struct Entry {
    name: String,
    form: Form,
    /// The first one that was found.
    first: Attribute,
    /// Why it is not part of an attribute of the same name.
    apart: Option<Warning>,
}

impl Entry {
    fn attribute(&self) -> Attribute {
        let mut attribute = self.first.clone();
        attribute.name.clone_from(&self.name);
        attribute.ty = self.form.ty;
        attribute.scale.clone_from(&self.form.scale);
        attribute.offset.clone_from(&self.form.offset);
        attribute
    }
}

/// What the stored values of an attribute mean.
#[derive(Debug, Clone, PartialEq)]
struct Form {
    /// Of the quantity.
    quantity: String,
    ty: AttributeType,
    scale: Vec<f64>,
    offset: Vec<f64>,
    /// From the unit of the file to that of the quantity; counts only where units differ.
    unit: f64,
}

impl Form {
    fn of(attribute: &Attribute) -> Self {
        let plain = attribute.scale.iter().all(|s| *s == 1.0) && attribute.offset.iter().all(|o| *o == 0.0);
        let (quantity, unit) = match (attribute.name.as_str(), attribute.ty) {
            ("scan angle rank", _) => ("scan angle", 1.0),
            ("scan angle", AttributeType::Int16) if plain => ("scan angle", SCAN_ANGLE_STEP),
            ("time", AttributeType::Float32 | AttributeType::Float64) => ("timestamp", 1.0),
            (name, _) => (name, 1.0),
        };
        let Attribute { ty, scale, offset, .. } = attribute.clone();
        Self { quantity: quantity.to_owned(), ty, scale, offset, unit }
    }

    /// What the attribute of the union has before another one joins it.
    fn alone(&self) -> Self {
        if NORMALS.contains(&self.quantity.as_str()) {
            return Self { ty: AttributeType::Float32, ..self.plain() };
        }
        self.clone()
    }

    fn plain(&self) -> Self {
        let Self { quantity, ty, scale, offset, .. } = self.clone();
        Self { quantity, ty, scale: vec![1.0; scale.len()], offset: vec![0.0; offset.len()], unit: 1.0 }
    }

    fn means_as(&self, other: &Self) -> bool {
        self.scale == other.scale && self.offset == other.offset && self.unit == other.unit
    }

    /// What holds the values of both.
    fn with(&self, other: &Self) -> Self {
        if NORMALS.contains(&self.quantity.as_str()) {
            return self.clone();
        }
        match self.means_as(other) {
            true => Self { ty: common_type(self.ty, other.ty), ..self.clone() },
            false => Self { ty: AttributeType::Float64, ..self.plain() },
        }
    }

    /// How values of this form become those of `target`.
    fn recast(&self, target: &Self) -> Option<Recast> {
        if !self.means_as(target) {
            let Self { scale, offset, unit, .. } = self.clone();
            return Some(Recast { ty: target.ty, linear: Some(Linear { scale, offset, unit }) });
        }
        (self.ty != target.ty).then_some(Recast { ty: target.ty, linear: None })
    }
}

/// Index in `entries` of the attribute with the same meaning, added if there is none. `taken`: those that other columns
/// of the scan have.
fn join(entries: &mut Vec<Entry>, form: &Form, attribute: &Attribute, taken: &[usize]) -> usize {
    let is_colour = |a: &Attribute| a.ty == AttributeType::UInt16 && a.elements == 3;
    // The name of the colour is taken, for three `u16`.
    let is_false_colour = attribute.name == "rgb" && !is_colour(attribute);
    let is_same = |(i, e): (usize, &Entry)| {
        e.form.quantity == form.quantity
            && e.first.elements == attribute.elements
            && (e.first.name != "rgb" || is_colour(&e.first) == is_colour(attribute))
            && !taken.contains(&i)
    };
    let same = |by_name: bool| {
        let named = |e: &Entry| !by_name || e.first.name == attribute.name;
        entries.iter().enumerate().position(|(i, e)| named(e) && is_same((i, e)))
    };
    let found = same(true).or_else(|| same(false));
    match found {
        Some(i) => {
            let entry = &mut entries[i];
            entry.form = entry.form.with(form);
            if entry.first.name != attribute.name && entry.apart.is_none() {
                entry.name.clone_from(&form.quantity);
            }
            i
        }
        None => {
            let (name, apart) = free_name(entries, attribute, is_false_colour);
            entries.push(Entry { name, form: form.alone(), first: attribute.clone(), apart });
            entries.len() - 1
        }
    }
}

/// The name of an attribute, with a number if that is another one's; then also a warning.
fn free_name(entries: &[Entry], attribute: &Attribute, is_taken: bool) -> (String, Option<Warning>) {
    let wanted = &attribute.name;
    let holder = entries.iter().find(|e| e.name == *wanted);
    if holder.is_none() && !is_taken {
        return (wanted.clone(), None);
    }
    let mut names = (2..).map(|n| format!("{wanted} ({n})"));
    let name = names.find(|name| entries.iter().all(|e| e.name != *name)).unwrap_or_default();
    let warning = holder.map(|holder| Warning::AttributesApart {
        name: wanted.clone(),
        elements: [holder.first.elements, attribute.elements],
        other: name.clone(),
    });
    (name, warning)
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType as T;

    fn shown(union: &Union) -> String {
        let shown = |a: &Attribute| format!("{} {}x{}", a.name, a.ty, a.elements);
        union.schema.attributes.iter().map(shown).collect::<Vec<_>>().join(", ")
    }

    fn union(scans: &[Vec<Attribute>]) -> Union {
        let scans: Vec<Arc<[Attribute]>> = scans.iter().map(|s| s.clone().into()).collect();
        Union::of(&scans)
    }

    impl Union {
        fn columns(&self, scan: usize) -> &[Placed] {
            &self.layouts[self.layout_of[scan] as usize].columns
        }
    }

    #[test]
    fn lists_that_scans_share_go_where_they_would_go_one_by_one() {
        let named =
            |names: &[&str]| -> Vec<Attribute> { names.iter().map(|n| Attribute::new(*n, T::Float64, 1)).collect() };
        // "timestamp" joins "time" until a scan has both
        let lists = [named(&["time"]), named(&["timestamp"]), named(&["time", "timestamp"]), named(&["h"])];
        let mut random = pointmill_testkit::Random::new(7);
        for _ in 0..50 {
            let order: Vec<usize> = (0..12).map(|_| random.below(4) as usize).collect();
            let shared: Vec<Arc<[Attribute]>> = lists.iter().map(|l| l.clone().into()).collect();
            let fast = Union::of(order.iter().map(|i| &shared[*i]));
            let plain = union(&order.iter().map(|i| lists[*i].clone()).collect::<Vec<_>>());
            assert_eq!(shown(&fast), shown(&plain));
            (0..12).for_each(|i| assert_eq!(fast.columns(i), plain.columns(i), "{order:?} {i}"));
            assert!(fast.layouts.len() <= 6 && plain.layouts.len() == 12);
        }
    }

    #[test]
    fn one_name_is_one_attribute_that_holds_all_values_and_rgb_comes_first() {
        let u = union(&[
            vec![Attribute::new("intensity", T::UInt16, 1), Attribute::new("height", T::Float32, 1)],
            vec![
                Attribute::new("height", T::Float64, 1),
                Attribute::new("rgb", T::UInt16, 3),
                Attribute::new("intensity", T::UInt16, 1),
            ],
        ]);
        assert_eq!(shown(&u), "rgb uint16x3, intensity uint16x1, height doublex1");
        let places = [0, 1].map(|i| u.columns(i).iter().map(|p| p.attribute).collect::<Vec<_>>());
        assert_eq!(places, [vec![1, 2], vec![2, 0, 1]]);
        assert_eq!(u.columns(0)[1].recast, Some(Recast { ty: T::Float64, linear: None }));
        assert!(u.columns(1).iter().all(|p| p.recast.is_none()) && u.warnings.is_empty());
        assert_eq!((u.schema.offsets, u.schema.stride), (vec![12, 18, 20], 28));
    }

    #[test]
    fn another_number_of_elements_is_another_attribute_and_told() {
        let u = union(&[vec![Attribute::new("h", T::UInt8, 1)], vec![Attribute::new("h", T::UInt8, 3)]]);
        assert_eq!(shown(&u), "h uint8x1, h (2) uint8x3");
        assert_eq!(u.warnings.len(), 1);
        // colours are three uint16, and nothing else is
        let u = union(&[vec![Attribute::new("rgb", T::Float32, 3)], vec![Attribute::new("rgb", T::UInt16, 3)]]);
        assert_eq!(shown(&u), "rgb uint16x3, rgb (2) floatx3");
    }

    #[test]
    fn wide_integers_stay() {
        let u = union(&[vec![Attribute::new("id", T::UInt64, 1)], vec![Attribute::new("id", T::UInt8, 1)]]);
        assert_eq!(shown(&u), "id uint64x1");
    }

    #[test]
    fn angles_of_both_kinds_of_las_become_degrees_and_one_kind_stays() {
        let rank = || vec![Attribute::new("scan angle rank", T::Int8, 1)];
        let fine = || vec![Attribute::new("scan angle", T::Int16, 1)];
        assert_eq!(shown(&union(&[rank(), rank()])), "scan angle rank int8x1");
        assert_eq!(shown(&union(&[fine(), fine()])), "scan angle int16x1");
        let both = union(&[rank(), fine(), fine()]);
        assert_eq!(shown(&both), "scan angle doublex1");
        let unit = |i: usize| both.columns(i)[0].recast.as_ref().and_then(|r| Some(r.linear.as_ref()?.unit));
        assert_eq!((unit(0), unit(1), unit(2)), (None, Some(0.006), Some(0.006)));
        assert_eq!(both.columns(0)[0].recast, Some(Recast { ty: T::Float64, linear: None }));
    }

    #[test]
    fn normals_are_single_precision_and_scales_are_applied_where_they_differ() {
        let mut scaled = Attribute::new("NormalX", T::Int8, 1);
        scaled.scale = vec![0.01];
        let u = union(&[vec![scaled.clone()], vec![Attribute::new("NormalX", T::Float32, 1)]]);
        assert_eq!((shown(&u), u.schema.attributes[0].scale.clone()), ("NormalX floatx1".to_owned(), vec![1.0]));
        assert!(u.columns(0)[0].recast.is_some() && u.columns(1)[0].recast.is_none());
        scaled.name = "height".to_owned();
        let same = union(&[vec![scaled.clone()], vec![scaled.clone()]]);
        assert_eq!((shown(&same), same.schema.attributes[0].scale[0]), ("height int8x1".to_owned(), 0.01));
        let u = union(&[vec![scaled], vec![Attribute::new("height", T::Int8, 1)]]);
        assert_eq!((shown(&u), u.schema.attributes[0].scale[0]), ("height doublex1".to_owned(), 1.0));
    }

    #[test]
    fn two_columns_of_a_scan_never_become_one() {
        let times = vec![Attribute::new("timestamp", T::Float64, 1), Attribute::new("time", T::Float32, 1)];
        assert_eq!(shown(&union(std::slice::from_ref(&times))), "timestamp doublex1, time floatx1");
        let other = vec![Attribute::new("time", T::Float64, 1)];
        assert_eq!(shown(&union(&[times, other])), "timestamp doublex1, time doublex1");
        let single = vec![Attribute::new("time", T::Float32, 1)];
        assert_eq!(shown(&union(&[single.clone(), single])), "time floatx1");
    }
}
