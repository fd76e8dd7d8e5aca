//! Outputs that are built together: octrees of several formats have one tree.

use super::octrees::ChosenSpacing;
use super::output::{OctreeOutput, OctreeWriter, Target};
use super::staging::StagedDataset;
use crate::error::ConvertError;
use crate::job::Build;
use crate::octree::{self, AnySink};
use crate::report::OutputReport;

/// The targets that are built together, by their index: octrees with the same nodes, any other alone. In the order of the
/// first of each.
pub(crate) fn groups(targets: &[Target]) -> Vec<Vec<usize>> {
    let tree = |i: usize| targets[i].output().octree().map(OctreeOutput::tree);
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for i in 0..targets.len() {
        let same = groups.iter_mut().find(|group| tree(i).is_some() && tree(group[0]) == tree(i));
        match same {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

/// Builds and writes the datasets of a group, one for each target.
pub(crate) fn write(
    targets: &[&Target],
    datasets: &[StagedDataset],
    build: Build<'_>,
) -> Result<Vec<OutputReport>, ConvertError> {
    let octrees: Vec<&dyn OctreeOutput> = targets.iter().filter_map(|target| target.output().octree()).collect();
    if octrees.len() == targets.len() {
        return write_octrees(&octrees, datasets, build);
    }
    targets.iter().zip(datasets).map(|(target, to)| target.output().write(build, to)).collect()
}

/// Builds the tree that `outputs` share, each in its dataset of `datasets`.
///
/// # Errors
/// Whatever one of them meets.
fn write_octrees(
    outputs: &[&dyn OctreeOutput],
    datasets: &[StagedDataset],
    build: Build<'_>,
) -> Result<Vec<OutputReport>, ConvertError> {
    let Build { cloud, rt, .. } = build;
    let Some(tree) = outputs.first().map(|output| output.tree()) else { return Ok(Vec::new()) };
    let spacing = ChosenSpacing::of(tree.sampling, tree.spacing, cloud)?;
    let begun = outputs.iter().zip(datasets).map(|(output, to)| output.begin(cloud, rt, spacing, to));
    let writers: Vec<Box<dyn OctreeWriter>> = begun.collect::<Result<_, _>>()?;
    let settings = tree.of(&spacing, cloud);
    let trees = match &writers[..] {
        [alone] => vec![alone.build(build, settings)?],
        several => {
            let sinks: Vec<&dyn AnySink> = several.iter().map(|writer| writer.sink()).collect();
            octree::build_all(build, settings, &sinks)?
        }
    };
    writers.into_iter().zip(trees).map(|(writer, tree)| writer.finish(tree)).collect()
}
