//! The attributes of a dataset, and the ranges of their values: as the dataset says, or else of a sample.

use pointmill_format::{Attribute, NodePoints};
use serde_json::{Value, json};

use crate::refusal::Refusal;
use crate::values::{Number, scaled};

/// Least and greatest value of each element, meant values.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Range {
    pub(super) min: Vec<f64>,
    pub(super) max: Vec<f64>,
    /// There may be points beyond.
    pub(super) is_sampled: bool,
}

impl Range {
    /// From the raw values that a dataset gives; `None` if they are not there, or no numbers.
    pub(super) fn of_raw(attribute: &Attribute, min: &[f64], max: &[f64]) -> Option<Self> {
        let mut range = Self { min: Vec::new(), max: Vec::new(), is_sampled: false };
        for element in 0..attribute.elements {
            let ends = [min.get(element)?, max.get(element)?].map(|raw| scaled(attribute, element, *raw));
            if !ends.iter().all(|v| v.is_finite()) {
                return None;
            }
            range.min.push(ends[0].min(ends[1])); // a scale may be negative
            range.max.push(ends[0].max(ends[1]));
        }
        Some(range)
    }

    /// Of raw values, those of a point side by side; `None` without one that is finite, for any element.
    fn of_values(attribute: &Attribute, values: impl Iterator<Item = f64>) -> Option<Self> {
        let elements = attribute.elements;
        let mut range =
            Self { min: vec![f64::INFINITY; elements], max: vec![f64::NEG_INFINITY; elements], is_sampled: true };
        for (index, raw) in values.enumerate() {
            let element = index % elements.max(1);
            let value = scaled(attribute, element, raw);
            if let (true, Some(min), Some(max)) =
                (value.is_finite(), range.min.get_mut(element), range.max.get_mut(element))
            {
                (*min, *max) = (min.min(value), max.max(value));
            }
        }
        range.min.iter().zip(&range.max).all(|(min, max)| min <= max).then_some(range)
    }

    fn merge(&mut self, other: &Self) {
        self.min.iter_mut().zip(&other.min).for_each(|(a, b)| *a = a.min(*b));
        self.max.iter_mut().zip(&other.max).for_each(|(a, b)| *a = a.max(*b));
    }
}

/// Columns of a dataset, in their order.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes {
    /// As the columns of decoded points.
    pub(super) all: Vec<Attribute>,
    /// For each of them, if known.
    pub(super) ranges: Vec<Option<Range>>,
}

impl Attributes {
    /// Attributes with the ranges that the dataset gives.
    pub(super) fn new(known: impl IntoIterator<Item = (Attribute, Option<Range>)>) -> Self {
        let (all, ranges) = known.into_iter().unzip();
        Self { all, ranges }
    }

    /// Widens ranges that the dataset does not give by the values of some points.
    pub(super) fn sample(&mut self, points: &NodePoints) {
        for (place, column) in points.columns().iter().enumerate() {
            let values = (0..column.len()).filter_map(|index| Number::of_column(column, index));
            self.sample_values(place, values.map(Number::as_f64));
        }
    }

    /// Widens the range of one attribute, unless the dataset gives it, by raw values.
    pub(super) fn sample_values(&mut self, place: usize, values: impl Iterator<Item = f64>) {
        let (Some(attribute), Some(range)) = (self.all.get(place), self.ranges.get_mut(place)) else { return };
        match range {
            Some(range) if !range.is_sampled => {}
            Some(range) => Range::of_values(attribute, values).iter().for_each(|more| range.merge(more)),
            None => *range = Range::of_values(attribute, values),
        }
    }

    /// True if a range is missing.
    pub(super) fn is_incomplete(&self) -> bool {
        self.ranges.iter().any(Option::is_none)
    }

    /// The place of an attribute that is requested, and what its values are relative to.
    pub(super) fn find(&self, name: &str) -> Result<(usize, f64), Refusal> {
        let Some(place) = self.all.iter().position(|a| a.name == name) else {
            let names: Vec<&str> = self.all.iter().map(|a| a.name.as_str()).collect();
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(Refusal::bad(format!("there is no attribute \"{name}\"; there are: {known}")));
        };
        let least = self.range(place).and_then(|range| range.min.first().copied());
        Ok((place, least.unwrap_or(0.0)))
    }

    pub(super) fn range(&self, place: usize) -> Option<&Range> {
        self.ranges.get(place)?.as_ref()
    }

    /// The range of the first element of an attribute.
    pub(super) fn range_of(&self, name: &str) -> Option<[f64; 2]> {
        let range = self.range(self.all.iter().position(|a| a.name == name)?)?;
        Some([*range.min.first()?, *range.max.first()?])
    }

    /// True unless all channels of `rgb` are known to be at most 255.
    pub(super) fn is_16_bit(&self) -> bool {
        let range = self.all.iter().position(|a| a.name == "rgb").and_then(|place| self.range(place));
        range.is_none_or(|range| range.max.iter().any(|v| *v > 255.0))
    }

    pub(super) fn has_colour(&self) -> bool {
        self.all.iter().any(|a| matches!(a.name.as_str(), "rgb" | "rgba") && a.elements >= 3)
    }

    pub(super) fn to_json(&self) -> Value {
        let one = |(attribute, range): (&Attribute, &Option<Range>)| {
            let mut object = json!({
                "name": attribute.name,
                "description": attribute.description,
                "type": attribute.ty.potree_name(),
                "elements": attribute.elements,
                "min": range.as_ref().map(|r| &r.min),
                "max": range.as_ref().map(|r| &r.max),
            });
            if range.as_ref().is_some_and(|r| r.is_sampled) {
                object["sampled"] = true.into();
            }
            object
        };
        self.all.iter().zip(&self.ranges).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::AttributeType;

    use super::*;

    #[test]
    fn ranges_are_of_meant_values_and_those_of_the_dataset_stay() {
        let mut turned = Attribute::new("a", AttributeType::Int16, 1);
        (turned.scale, turned.offset) = (vec![-0.5], vec![10.0]);
        let known = Range::of_raw(&turned, &[0.0], &[4.0]);
        assert_eq!(known, Some(Range { min: vec![8.0], max: vec![10.0], is_sampled: false }));
        let mut attributes = Attributes::new([(turned.clone(), known.clone()), (turned, None)]);
        for place in [0, 1] {
            attributes.sample_values(place, [2.0, f64::NAN].into_iter());
            attributes.sample_values(place, [-2.0].into_iter());
            attributes.sample_values(place, [f64::INFINITY].into_iter());
        }
        let sampled = Range { min: vec![9.0], max: vec![11.0], is_sampled: true };
        assert_eq!(attributes.ranges, [known, Some(sampled)]);
        assert_eq!(attributes.find("a"), Ok((0, 8.0)));
    }

    #[test]
    fn what_a_dataset_gives_in_part_or_as_no_number_is_no_range() {
        let rgb = Attribute::new("rgb", AttributeType::UInt16, 3);
        for (min, max) in [(&[][..], &[][..]), (&[0.0; 3], &[1.0; 2]), (&[f64::NAN; 3], &[1.0; 3])] {
            assert_eq!(Range::of_raw(&rgb, min, max), None);
        }
    }

    #[test]
    fn colours_have_8_bits_if_none_is_above_255() {
        let rgb = |max: f64| {
            let rgb = Attribute::new("rgb", AttributeType::UInt16, 3);
            let range = Range::of_raw(&rgb, &[0.0; 3], &[0.0, max, 0.0]);
            Attributes::new([(rgb, range)]).is_16_bit()
        };
        assert_eq!([255.0, 256.0].map(rgb), [false, true]);
        assert!(Attributes::default().is_16_bit() && !Attributes::default().has_colour());
    }
}
