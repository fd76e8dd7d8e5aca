//! What a COPC file is beside a scan: an octree.

use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::copc::{Dataset, Info, detect};
use serde_json::{Value, json};

use super::description::corners;
use crate::exit::Failure;
use crate::human::quantities::{count, number, plural};
use crate::human::text::{self, Table};

/// The octree of a COPC file.
pub(super) struct Octree {
    copc: Info,
    /// By the header.
    declared: u64,
    /// Nodes and points of each level.
    levels: Vec<[u64; 2]>,
}

/// The octree of the file, if it is COPC; or why there is none, although it says so.
pub(super) fn octree(file: &Path) -> (Option<Octree>, Option<Failure>) {
    if !detect(file) {
        return (None, None);
    }
    match read(file) {
        Ok(octree) => (Some(octree), None),
        Err(error) => (None, Some(error.into())),
    }
}

fn read(file: &Path) -> Result<Octree, ReadError> {
    let dataset = Dataset::open(file)?;
    let nodes = dataset.read_hierarchy()?;
    let mut levels = Vec::new();
    for node in &nodes {
        let level = usize::from(node.key.level);
        levels.resize(levels.len().max(level + 1), [0, 0]);
        levels[level][0] += 1;
        levels[level][1] += node.points;
    }
    Ok(Octree { copc: *dataset.copc_info(), declared: dataset.points_declared(), levels })
}

impl Octree {
    fn nodes(&self) -> u64 {
        self.levels.iter().map(|level| level[0]).sum()
    }

    fn points(&self) -> u64 {
        self.levels.iter().map(|level| level[1]).sum()
    }

    /// Adds the lines about it.
    pub(super) fn rows(&self, t: &mut Table) {
        let cube = self.copc.cube();
        let missing = if self.points() == self.declared {
            String::new()
        } else {
            format!(", {} (the header says {})", plural(self.points(), "point"), count(self.declared))
        };
        t.row("octree", plural(self.nodes(), "node") + &missing);
        t.row("cube", text::corners(&cube.min, &cube.max));
        t.row("spacing", format!("{} at the root, halved per level", number(self.copc.spacing)));
        for (level, [nodes, points]) in self.levels.iter().enumerate() {
            let word = if level == 0 { "levels" } else { "" };
            t.row(word, format!("{level}: {} in {}", plural(*points, "point"), plural(*nodes, "node")));
        }
    }

    pub(super) fn json(&self) -> Value {
        json!({
            "nodes": self.nodes(),
            "points": self.points(),
            "levels": self.levels.len(),
            "nodes_per_level": self.levels.iter().map(|l| l[0]).collect::<Vec<_>>(),
            "points_per_level": self.levels.iter().map(|l| l[1]).collect::<Vec<_>>(),
            "cube": corners(&self.copc.cube()),
            "spacing": self.copc.spacing,
            "gps_time": self.copc.gps_time,
        })
    }
}
