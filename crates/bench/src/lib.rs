//! What the measurements of pointmill share: generated scans, a LAS writer, and the cost of a child process.
//!
//! * `cargo bench -p pointmill-bench --features criterion` measures the inner loops.
//! * `cargo run --release -p pointmill-bench --bin side_by_side -- --help` measures whole programs, pointmill and (when
//!   they are on `PATH`) PotreeConverter and copc_converter, on generated scans.

pub mod las_file;
pub mod process;
pub mod scene;
