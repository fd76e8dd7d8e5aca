//! What a comma between digits may be, beside a decimal mark.

/// Numbers of a position.
pub(super) const AXES: usize = 3;

/// The first digits with a comma between them.
pub(super) fn example(rows: &[Vec<u8>]) -> String {
    let is_part = |b: &u8| b.is_ascii_digit() || b"+-.,".contains(b);
    let has_inner =
        |field: &&[u8]| field.windows(3).any(|w| w[1] == b',' && w[0].is_ascii_digit() && w[2].is_ascii_digit());
    let mut fields = rows.iter().flat_map(|row| row.split(|b| !is_part(b)));
    let found = fields.find(has_inner).unwrap_or(b"1,5");
    String::from_utf8_lossy(found).trim_end_matches(',').chars().take(40).collect()
}

/// True if decimal commas may as well group thousands: three digits follow each, never more than three stand before it,
/// and a coordinate below 1000 has none. `rows`: fields with points as decimal marks.
pub(super) fn groups_thousands(rows: &[Vec<Vec<u8>>]) -> bool {
    let mut bare = false;
    for field in rows.iter().flat_map(|row| row.iter().take(AXES)) {
        let digits = field.strip_prefix(b"-").unwrap_or(field);
        match digits.iter().position(|b| *b == b'.') {
            None if digits.len() > 3 || digits == b"0" => return false,
            None => bare |= !digits.is_empty() && digits.iter().all(u8::is_ascii_digit),
            Some(at @ 1..=3) if digits.len() == at + 4 && digits[0] != b'0' => {}
            Some(_) => return false,
        }
    }
    bare
}

/// True if whole numbers between commas look like coordinates and their decimals by turns: only the second of each two
/// has leading zeros. `rows`: fields between commas.
pub(super) fn joins_decimals(rows: &[Vec<Vec<u8>>]) -> bool {
    let mut zeros = [false; 2];
    for fields in rows {
        if fields.len() < 2 * AXES || fields.len() % 2 == 1 {
            return false;
        }
        for (i, field) in fields.iter().enumerate() {
            let digits = if i % 2 == 0 { field.strip_prefix(b"-").unwrap_or(field) } else { field };
            if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
                return false;
            }
            zeros[i % 2] |= digits.len() > 1 && digits[0] == b'0';
        }
    }
    zeros == [false, true]
}

/// True if some numbers are set apart by commas alone, which are no decimal marks and group no thousands.
pub(super) fn joins_numbers(rows: &[Vec<u8>]) -> bool {
    let mut joined = false;
    for field in rows.iter().flat_map(|row| row.split(|b| *b <= b' ')) {
        let parts: Vec<_> = field.split(|b| *b == b',').collect();
        let has_point = field.contains(&b'.');
        let thousands = |part: &&[u8]| part.split(|b| *b == b'.').next().is_some_and(|p| p.len() == 3);
        let points_group = field.iter().filter(|b| **b == b'.').count() > 0 && parts.len() == 2 && {
            let groups: Vec<_> = parts[0].split(|b| *b == b'.').collect();
            groups.len() > 1 && groups[1..].iter().all(|g| g.len() == 3)
        };
        if parts.len() > 1 && (parts[1..].iter().all(thousands) || points_group) {
            return false;
        }
        joined |= parts.len() > 2 || (parts.len() == 2 && has_point);
    }
    joined
}
