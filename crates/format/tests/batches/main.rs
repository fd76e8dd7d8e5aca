//! Quantised batches as a renderer or a converter meets them: files of an independent encoder are read and reproduced
//! byte for byte, what is written is read back within the promised error, and hostile bytes end in an error.

mod golden;
mod hostile;
mod round_trip;
mod util;
