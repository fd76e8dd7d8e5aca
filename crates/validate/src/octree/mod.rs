//! What is checked of every additive octree, whatever format it is in: boxes, spacing, seams, coverage, and the figures of
//! quality. `docs/formats/potree2.md` is the only source of what is expected.
//!
//! A format reads its index into a [`tree::Tree`], implements [`walk::Nodes`], and has its nodes looked at ([`look::Look`]).

pub(crate) mod blocks;
mod cache;
pub(crate) mod coverage;
pub(crate) mod expect;
pub(crate) mod first_view;
pub(crate) mod grid;
pub(crate) mod lattices;
pub(crate) mod look;
pub(crate) mod node_points;
pub(crate) mod quality;
pub(crate) mod seams;
pub(crate) mod spacing;
pub(crate) mod tree;
pub(crate) mod walk;
