//! What a dataset says of itself, as the page reads it.

use std::path::Path;

use pointmill_format::Aabb;
use serde_json::{Map, Value, json};

use super::ranges::Attributes;

/// The version of the protocol.
const VERSION: u32 = 1;

/// Of any kind of dataset.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub(super) kind: &'static str,
    /// For people.
    pub(super) format: String,
    pub(super) name: String,
    pub(super) points: Option<u64>,
    /// The tightest box that the dataset says, world coordinates.
    pub(super) bounds: Aabb,
    /// A proj4 definition or nothing.
    pub(super) projection: String,
    pub(super) attributes: Attributes,
    pub(super) has_colour: bool,
    /// Keys of one kind alone.
    pub(super) own: Map<String, Value>,
}

impl Scene {
    /// A dataset without a name has that of its folder or file; a folder or file with the name of a kind that of what it is in.
    pub(super) fn name_after(&mut self, path: &Path) {
        if self.name.is_empty() {
            let kinds = pointmill_format::DatasetKind::ALL;
            let is_kind = |name: &str| kinds.iter().any(|kind| kind.name() == name || kind.marker_file() == name);
            let names = path.ancestors().filter_map(|part| part.file_name()).map(|name| name.to_string_lossy());
            self.name = names.into_iter().find(|name| !is_kind(name)).unwrap_or_default().into_owned();
        }
    }

    pub(super) fn to_json(&self, number: usize, file: Option<&str>) -> Value {
        let mut scene = json!({
            "version": VERSION,
            "kind": self.kind,
            "format": self.format,
            "name": self.name,
            "points": self.points,
            "bounds": box_json(&self.bounds),
            "projection": self.projection,
            "attributes": self.attributes.to_json(),
            "colour": self.has_colour,
            "files": format!("data/{number}/"),
        });
        if let Some(object) = scene.as_object_mut() {
            object.extend(self.own.clone());
            object.extend(file.map(|file| ("file".to_owned(), file.into())));
        }
        scene
    }
}

/// `{"min": [x, y, z], "max": …}`; zeros for a box without points.
pub(super) fn box_json(bounds: &Aabb) -> Value {
    let bounds = if bounds.is_empty() { Aabb { min: [0.0; 3], max: [0.0; 3] } } else { *bounds };
    json!({ "min": bounds.min, "max": bounds.max })
}

/// Keys with their values.
pub(super) fn keys<const N: usize>(keys: [(&str, Value); N]) -> Map<String, Value> {
    keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
