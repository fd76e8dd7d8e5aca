//! What a look at the first points says of all.

use std::ops::ControlFlow;

use pointmill_format::{Scratch, Wanted};

use super::fields::Depth;
use crate::cloud::Intake;
use crate::error::ConvertError;
use crate::plan::ExportFormat;
use crate::sources::Sources;

/// The depth that colours seem to have, by the first batch of the first scan that has some; where colours are always written
/// with 16 bits, these.
pub(super) fn colour_depth(format: ExportFormat, sources: &Sources, intake: &Intake) -> Result<Depth, ConvertError> {
    let rgb = intake.schema.rgb();
    let coloured = |i: &usize| intake.of(&sources.all[*i]).has(rgb) && sources.all[*i].pieces > 0;
    let is_16_bit = sources.all.iter().any(|source| source.rgb_is_16_bit);
    let first = (0..sources.all.len()).find(coloured).filter(|_| format == ExportFormat::Ply && rgb.is_some());
    let Some(first) = first else { return Ok(Depth::Sixteen) };
    let scan = sources.scan(first)?;
    let (Ok(wanted), mut depth) = (Wanted::named(scan.info(), ["rgb"]), Depth::Sixteen) else {
        return Ok(Depth::Sixteen);
    };
    // what cannot be read fails when it is read
    let _ = scan.decode(0, &wanted, &mut Scratch::default(), &mut |batch| {
        depth = batch.column::<u16>("rgb").map_or(Depth::Sixteen, |colours| Depth::of(colours, is_16_bit));
        ControlFlow::Break(())
    });
    Ok(depth)
}
