//! What the measurements of pointmill share: generated scans, a LAS writer, and the cost of a child process.
//!
//! * `cargo bench -p pointmill-bench --features criterion` measures the inner loops.
//! * `cargo run --release -p pointmill-bench --bin side_by_side -- --help` measures whole programs on generated scans:
//!   pointmill, `floor` (read, sort and write, nothing else), `decode` (one decode by the `laz` crate), and PotreeConverter
//!   and copc_converter when they are on `PATH`.

pub mod las_file;
pub mod las_layout;
pub mod process;
pub mod scene;
