//! Lines of numbers without more order than that.

use super::head::Head;
use super::options::TextOptions;
use super::rows::is_data;
use super::table::Table;
use crate::scan::source::Source;
use crate::scan::tabular::lines;
use crate::{ReadError, Scan};

pub(super) fn open(source: Source, options: &TextOptions) -> Result<Box<dyn Scan>, ReadError> {
    let mut head = Head::read(&source, options, false)?;
    let columns = head.columns(&source, options)?;
    let index = lines::index(&source, head.start, u64::MAX, is_data)?;
    let format = format!("text, {} columns {}", head.numeric.len(), head.dialect.describe());
    Ok(Box::new(Table::new(source, format, head, index, is_data).scan(columns)?))
}
