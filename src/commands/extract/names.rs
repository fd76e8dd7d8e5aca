//! Names of the files: one component, safe on all systems, and no two the same.

use pointmill_format::{ImageEncoding, ImageKind, ScanImage};

/// Characters of an image's own name that go into that of its file.
const MAX_CHARS: usize = 50;

/// "003_Hall_pano.jpg"; "003_Hall_pano_preview.jpg" for what cannot be projected.
pub(super) fn image(image: &ScanImage, encoding: ImageEncoding) -> String {
    format!("{}.{}", stem(image), encoding.extension())
}

/// "003_Hall_pano_mask.png".
pub(super) fn mask(image: &ScanImage) -> String {
    format!("{}_mask.png", stem(image))
}

/// The number keeps names apart; of an image in several kinds, each has its own ending.
fn stem(image: &ScanImage) -> String {
    let ending = match image.kind {
        ImageKind::Spherical => "_spherical",
        ImageKind::Cylindrical => "_cylindrical",
        ImageKind::VisualReference => "_preview",
        _ => "_pinhole",
    };
    let name = safe(&image.name);
    let separator = if name.is_empty() { "" } else { "_" };
    format!("{:03}{separator}{name}{ending}", image.number)
}

/// Letters, digits and a few signs; all else, also what separates folders, becomes a low line.
fn safe(name: &str) -> String {
    let replaced = name.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '.') { c } else { '_' });
    let text: String = replaced.take(MAX_CHARS).collect();
    text.trim_matches(['.', '_']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_its_folder_or_means_something_to_a_system() {
        let table = [
            ("Hall pano", "Hall_pano"),
            ("../../etc/passwd", "etc_passwd"),
            ("C:\\con", "C__con"),
            ("a\0b\nc", "a_b_c"),
            ("Höhe 3.5", "Höhe_3.5"),
            ("..", ""),
            ("", ""),
            ("*?<>|\"", ""),
        ];
        for (name, expected) in table {
            assert_eq!(safe(name), expected, "{name:?}");
        }
        assert!(safe(&"ö".repeat(1000)).len() <= 4 * MAX_CHARS, "a file's name has at most 255 bytes");
    }
}
