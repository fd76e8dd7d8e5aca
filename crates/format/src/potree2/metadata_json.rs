//! Writes `metadata.json`.

use super::Metadata;

pub(super) fn to_json(_metadata: &Metadata) -> String {
    String::new()
}
