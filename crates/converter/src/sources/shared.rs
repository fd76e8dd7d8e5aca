//! What many inputs have in common is kept once.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use pointmill_format::{Attribute, Crs, ScanInfo};

use super::source::Stored;
use super::survey::Fineness;

/// Values that were seen. Equal ones share memory.
#[derive(Default)]
pub(super) struct Shared {
    formats: Known<str>,
    systems: Known<Crs>,
    attributes: Known<[Attribute]>,
    stored: Known<Stored>,
}

impl Shared {
    pub(super) fn format(&mut self, format: &str) -> Arc<str> {
        self.formats.share(hash_of(|h| format.hash(h)), format, || format.into())
    }

    pub(super) fn crs(&mut self, crs: &Crs) -> Arc<Crs> {
        let hash = hash_of(|h| {
            (&crs.wkt, crs.epsg, crs.vertical_epsg, &crs.citation, &crs.proj4).hash(h);
            format!("{:?}{:?}", crs.unit, crs.vertical_unit).hash(h);
        });
        self.systems.share(hash, crs, || Arc::new(crs.clone()))
    }

    pub(super) fn stored(&mut self, stored: &Stored) -> Arc<Stored> {
        let hash = hash_of(|h| {
            stored.lattice.map(|l| [l.scale, l.offset].map(|v| v.map(f64::to_bits))).hash(h);
            stored.fineness.map(Fineness::bits).hash(h);
        });
        self.stored.share(hash, stored, || Arc::new(stored.clone()))
    }

    pub(super) fn attributes(&mut self, info: &ScanInfo) -> Arc<[Attribute]> {
        let all = &info.attributes;
        self.attributes.share(hash_of(|h| hash_attributes(all, h)), all, || Arc::clone(all))
    }
}

/// Feeds a hasher with all that tells lists of attributes apart.
pub(super) fn hash_attributes(attributes: &[Attribute], hasher: &mut impl Hasher) {
    for a in attributes {
        (&a.name, &a.description, a.ty, a.elements).hash(hasher);
        a.scale.iter().chain(&a.offset).chain(a.no_data.iter().flatten()).for_each(|v| v.to_bits().hash(hasher));
    }
}

fn hash_of(feed: impl FnOnce(&mut DefaultHasher)) -> u64 {
    let mut hasher = DefaultHasher::new();
    feed(&mut hasher);
    hasher.finish()
}

/// Values by their hash.
struct Known<T: ?Sized>(HashMap<u64, Vec<Arc<T>>>);

impl<T: ?Sized> Default for Known<T> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<T: ?Sized + PartialEq> Known<T> {
    fn share(&mut self, hash: u64, value: &T, make: impl FnOnce() -> Arc<T>) -> Arc<T> {
        let alike = self.0.entry(hash).or_default();
        if let Some(known) = alike.iter().find(|known| ***known == *value) {
            return Arc::clone(known);
        }
        let made = make();
        alike.push(Arc::clone(&made));
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::AttributeType;

    #[test]
    fn equal_values_are_one_and_others_are_not() {
        let info = |scale: f64| {
            let mut info = ScanInfo::new("x", "LAS 1.2", 1);
            let mut height = Attribute::new("height", AttributeType::Int16, 1);
            height.scale = vec![scale];
            info.attributes = [height].into();
            info
        };
        let mut shared = Shared::default();
        let (a, b) = (shared.attributes(&info(0.01)), shared.attributes(&info(0.01)));
        assert!(Arc::ptr_eq(&a, &b) && !Arc::ptr_eq(&a, &shared.attributes(&info(0.02))));
        assert!(Arc::ptr_eq(&shared.format("LAS 1.2"), &shared.format("LAS 1.2")));
        let (utm, other) = (Crs::new(None, Some(32_633), None), Crs::new(None, Some(32_634), None));
        assert!(Arc::ptr_eq(&shared.crs(&utm), &shared.crs(&utm.clone())));
        assert_eq!((&*shared.crs(&utm), &*shared.crs(&other)), (&utm, &other));
    }
}
