//! What a picture shows, and how.

use pointmill_format::Aabb;
use pointmill_format::batches::{Precision, distance_to_box};
use pointmill_format::bintree::{Material, distance_range, switch_distance};
use pointmill_format::octree::{Order, Selection, visible_nodes};
use std::mem::MaybeUninit;

use crate::border::{buffer, fill, given};
use crate::camera::{PmCamera, View};
use crate::dataset::{Content, PM_NO_NODE, PmDataset};
use crate::nodes::{PM_NODE_DRAWABLE, PM_NODE_LEAF, PM_NODE_PROXY, record_bounds};
use crate::status::{Fault, Outcome, PmStatus, guard};

/// Which octree nodes come first.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmOrder {
    /// By the radius of the node's sphere in the picture.
    Radius = 0,
    /// By that radius, divided by one plus the angle to the direction of view in radians (Fraiss, "Rendering Large Point
    /// Clouds in Unity", 2017).
    RadiusAndAngle = 1,
}

/// How the points of a node of a binary tree are drawn.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmMaterial {
    /// The dataset is no binary tree.
    None = 0,
    /// One pixel per point: D_min is beyond the switch distance.
    Far = 1,
    /// A disc of the point's radius: D_max is before the switch distance.
    Near = 2,
    /// Both: two passes, each drops the points of the other side of the switch distance.
    Both = 3,
}

/// How much a picture shows.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmSelection {
    /// Points, at most; the first node is shown whatever the budget is.
    pub budget: u64,
    /// Octrees: nodes whose sphere has a smaller radius in the picture, in pixels, are not shown.
    pub min_node_pixels: f64,
    /// Binary trees: radius of a point near by, world units, > 0: decides the switch distance.
    pub point_radius: f64,
    /// Octrees: a value of PmOrder.
    pub order: u32,
    /// Octrees: 1 reads chunks of the hierarchy as they are needed. 0 reads nothing: proxies in sight are listed with
    /// PM_NODE_PROXY, for pm_load() on another thread.
    pub load: u32,
}

/// A node to draw.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmDraw {
    /// Its number.
    pub node: u32,
    /// Octrees: its parent, which stands before it. Else PM_NO_NODE.
    pub parent: u32,
    /// Flags of PmNode.
    pub flags: u32,
    /// A value of PmMaterial.
    pub material: PmMaterial,
    /// Batches: the fewest bits of a position that keep the error within half a pixel, 10, 20 or 30. Else 0.
    pub bits: u32,
    /// 0
    pub reserved: u32,
    /// Its points; 0 of a proxy.
    pub points: u64,
    /// From the eye to the nearest point of its box, 0 inside, world units.
    pub d_min: f64,
    /// From the eye to the farthest corner of its box, world units.
    pub d_max: f64,
    /// Octrees: radius of its sphere in the picture, pixels; infinite from inside. Else 0.
    pub pixels: f64,
}

impl PmDraw {
    fn new(node: u32, points: u64, bounds: &Aabb, eye: [f64; 3]) -> Self {
        let [d_min, d_max] = distance_range(bounds, eye);
        Self {
            node,
            parent: PM_NO_NODE,
            flags: PM_NODE_LEAF | PM_NODE_DRAWABLE,
            material: PmMaterial::None,
            bits: 0,
            reserved: 0,
            points,
            d_min,
            d_max,
            pixels: 0.0,
        }
    }
}

impl PmMaterial {
    fn of(material: Material) -> Self {
        match material {
            Material::Far => Self::Far,
            Material::Near => Self::Near,
            Material::Both => Self::Both,
        }
    }
}

impl PmDataset {
    fn select(&self, camera: &PmCamera, wanted: &PmSelection) -> Outcome<Vec<PmDraw>> {
        let view = camera.view(self.axes)?;
        match &self.content {
            Content::Octree(_) => self.select_nodes(&view, wanted),
            Content::Bintree(_) => self.select_leaves(&view, wanted, camera),
            Content::Batches(_) => Ok(self.select_batches(&view, wanted, camera)),
        }
    }

    fn select_nodes(&self, view: &View, wanted: &PmSelection) -> Outcome<Vec<PmDraw>> {
        let tree = self.octree("nodes are selected in octrees")?;
        let order = match wanted.order {
            0 => Order::Radius,
            1 => Order::RadiusAndAngle,
            other => return Err(Fault::argument(format!("the order is {other}; there are 0 and 1"))),
        };
        let selection = Selection { budget: wanted.budget, order, min_node_pixels: wanted.min_node_pixels };
        let at = |key| tree.at(key, wanted.load != 0);
        let shown = visible_nodes(&*tree.octree, &view.viewpoint, &selection, at)?;
        let ids: Vec<u32> = shown.iter().map(|n| tree.id(n.node.key).unwrap_or(PM_NO_NODE)).collect();
        let draw = shown.iter().zip(&ids).map(|(shown, id)| {
            let bounds = tree.octree.info().node_box(shown.node.key);
            let leaf = if shown.node.child_mask == 0 { PM_NODE_LEAF } else { 0 };
            PmDraw {
                parent: shown.parent.and_then(|parent| ids.get(parent).copied()).unwrap_or(PM_NO_NODE),
                flags: if shown.node.is_proxy { PM_NODE_PROXY } else { PM_NODE_DRAWABLE | leaf },
                pixels: shown.pixels,
                ..PmDraw::new(*id, shown.points, &bounds, view.eye)
            }
        });
        Ok(draw.collect())
    }

    fn select_leaves(&self, view: &View, wanted: &PmSelection, camera: &PmCamera) -> Outcome<Vec<PmDraw>> {
        let Content::Bintree(leaves) = &self.content else { return Ok(Vec::new()) };
        let switch = switch_of(wanted.point_radius, camera.vertical_fov, camera.height.into())?;
        let list = leaves.tree.draw_list(view.eye, switch, Some(&view.frustum));
        let draw = list.into_iter().filter_map(|(leaf, material)| {
            let node = leaves.tree.node(leaf)?;
            let draw = PmDraw::new(leaf, node.count, &node.bounds, view.eye);
            Some(PmDraw { material: PmMaterial::of(material), ..draw })
        });
        Ok(nearest(draw.collect(), wanted.budget))
    }

    fn select_batches(&self, view: &View, wanted: &PmSelection, camera: &PmCamera) -> Vec<PmDraw> {
        let Content::Batches(batches) = &self.content else { return Vec::new() };
        let extent = batches.header().tight.extent().iter().fold(0.0, |longest: f64, side| longest.max(*side));
        let near = if camera.near > 0.0 { camera.near } else { (extent * NEAR).max(f64::MIN_POSITIVE) };
        let draw = (0u32..).zip(batches.records()).filter_map(|(slot, record)| {
            let bounds = record_bounds(batches, record);
            let distance = distance_to_box(view.eye, bounds.min, bounds.max);
            let longest = record.sides().into_iter().fold(0.0, f64::max);
            let bits =
                Precision::for_error(longest, distance, near, view.focal).min(batches.header().precision()).bits();
            let draw = PmDraw::new(slot, record.points.into(), &bounds, view.eye);
            view.frustum.may_see(&bounds).then_some(PmDraw { bits, ..draw })
        });
        nearest(draw.collect(), wanted.budget)
    }
}

/// A near plane of 0, as a part of the extent: nearer than that no bits are added.
const NEAR: f64 = 1e-5;

/// The nearest first, as far as the budget goes.
fn nearest(mut list: Vec<PmDraw>, budget: u64) -> Vec<PmDraw> {
    list.sort_by(|a, b| a.d_min.total_cmp(&b.d_min).then(a.node.cmp(&b.node)));
    let mut total = 0u64;
    let fits = list.iter().enumerate().take_while(|(i, draw)| {
        total = total.saturating_add(draw.points);
        *i == 0 || total <= budget
    });
    let count = fits.count();
    list.truncate(count);
    list
}

fn switch_of(point_radius: f64, vertical_fov: f64, height: f64) -> Outcome<f64> {
    let is_sound = point_radius > 0.0 && point_radius.is_finite() && vertical_fov > 0.0 && height > 0.0;
    let distance = switch_distance(point_radius, vertical_fov, height);
    if !is_sound || !distance.is_finite() || distance < 0.0 {
        let text = format!(
            "points of radius {point_radius}, {vertical_fov} radians and {height} pixels have no switch distance"
        );
        return Err(Fault::argument(text));
    }
    Ok(distance)
}

/// What a picture shows of the dataset:
///
/// - Of an octree the nodes in sight that are large in it, the most urgent first, each behind its parent, until one does not
///   fit the budget any more: the traversal of viewers.
/// - Of a binary tree the leaves in sight with their material by D_min and D_max, the nearest first, until one does not fit.
/// - Of batches those in sight with the bits that they need, the nearest first, until one does not fit.
///
/// `*count`: how many there are; `list` has room for `capacity` of them. If that is too small, PM_STATUS_BUFFER, `*count`
/// is set and nothing else is written; PmInfo::nodes are always enough where no chunk is read. The same arguments give the
/// same list. May read the hierarchy from the disk (PmSelection::load). Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_select(
    dataset: Option<&PmDataset>,
    camera: Option<&PmCamera>,
    selection: Option<&PmSelection>,
    list: *mut PmDraw,
    capacity: usize,
    count: Option<&mut MaybeUninit<usize>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let count = count.ok_or_else(|| Fault::null("count"))?;
        let found = dataset.select(given(camera, "camera")?, given(selection, "selection")?)?;
        count.write(found.len());
        // SAFETY: the caller's promise
        let out = unsafe { buffer(list, capacity, "list") }?;
        fill(out, found.len(), found.into_iter(), "list")
    })
}

/// The distance at which points change from discs to single pixels: radius / tan(fov / height). `point_radius`: world
/// units, > 0. `vertical_fov`: radians. `height`: pixels. (Santana et al. 2019.) Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_switch_distance(
    point_radius: f64,
    vertical_fov: f64,
    height: f64,
    distance: Option<&mut MaybeUninit<f64>>,
) -> PmStatus {
    guard(|| crate::border::put(distance, "distance", switch_of(point_radius, vertical_fov, height)?))
}

/// The material of a box that lies between `d_min` and `d_max` from the eye (pm_distances()): PM_MATERIAL_FAR,
/// PM_MATERIAL_NEAR or PM_MATERIAL_BOTH. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_material(d_min: f64, d_max: f64, switch_distance: f64) -> PmMaterial {
    PmMaterial::of(Material::choose([d_min, d_max], switch_distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes::PmAxes;
    use crate::test_help::open;

    fn camera(eye: [f64; 3], forward: [f64; 3]) -> PmCamera {
        let up = [0.0, 0.0, 1.0];
        PmCamera { eye, forward, up, vertical_fov: 1.0, near: 0.0, far: 0.0, width: 800, height: 600 }
    }

    const ALL: PmSelection =
        PmSelection { budget: u64::MAX, min_node_pixels: 0.0, point_radius: 0.05, order: 0, load: 0 };

    /// From the south of the middle of the box.
    fn from_south(dataset: &PmDataset, away: f64) -> PmCamera {
        let bounds = dataset.about.tight.unwrap();
        let [x, _, z] = bounds.center();
        camera([x, bounds.min[1] - away, z], [0.0, 1.0, 0.0])
    }

    #[test]
    fn proxies_are_listed_unless_they_may_be_read() {
        let dataset = open("copc/pages.copc.laz", PmAxes::ZUp);
        let camera = from_south(&dataset, 50.0);
        let draw = dataset.select(&camera, &ALL).unwrap();
        let is_proxy = |draw: &&PmDraw| draw.flags == PM_NODE_PROXY;
        assert!(draw.iter().any(|draw| is_proxy(&draw) && draw.points == 0));
        let read = dataset.select(&camera, &PmSelection { load: 1, ..ALL }).unwrap();
        assert!(!read.iter().any(|draw| is_proxy(&draw)) && read.len() > draw.len());
        let points = read.iter().map(|draw| draw.points).sum::<u64>();
        assert_eq!(Some(points), dataset.about.points);
    }

    #[test]
    fn leaves_change_their_material_with_the_distance() {
        let dataset = open("bintree/packed", PmAxes::ZUp);
        let all = |away, material| {
            let draw = dataset.select(&from_south(&dataset, away), &ALL).unwrap();
            !draw.is_empty() && draw.iter().all(|draw| draw.material == material)
        };
        // 0.05 m, 1 radian over 600 pixels: they change at 30 m
        assert!(all(1000.0, PmMaterial::Far));
        assert!(dataset.select(&from_south(&dataset, 1000.0), &PmSelection { point_radius: 0.0, ..ALL }).is_err());
        assert!(
            dataset.select(&from_south(&dataset, 1000.0), &PmSelection { order: 2, ..ALL }).is_ok(),
            "of octrees only"
        );
    }

    #[test]
    fn a_dataset_without_points_shows_nothing() {
        let dataset = open("batches/empty.qbatch", PmAxes::ZUp);
        assert_eq!(dataset.select(&camera([0.0; 3], [0.0, 1.0, 0.0]), &ALL).unwrap(), []);
        assert_eq!(dataset.node_count(), 0);
    }

    #[test]
    fn the_first_is_shown_whatever_the_budget_is() {
        for name in ["potree2/default", "bintree/packed", "batches/example.qbatch"] {
            let dataset = open(name, PmAxes::ZUp);
            let draw = dataset.select(&from_south(&dataset, 50.0), &PmSelection { budget: 0, ..ALL }).unwrap();
            assert_eq!(draw.len(), 1, "{name}");
        }
    }
}
