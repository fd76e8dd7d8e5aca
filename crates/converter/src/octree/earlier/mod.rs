//! Units that are taken from an earlier tree, to which points are added: those that the new points do not touch have the same
//! nodes again. Their bytes are copied, and what they hand up and sideways is put together from the earlier nodes
//! (docs/design/work-units.md, section 6, says why that is the same).
//!
//! [`nodes`] are those of the earlier tree, [`division`] finds its units again, [`samples`] what they had taken near their borders;
//! [`known`] brings these together with the new units, and [`take`] takes one.

mod division;
mod known;
mod nodes;
mod samples;
mod take;

pub(super) use known::Earlier;
pub(super) use take::Taken;
