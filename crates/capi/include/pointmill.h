/*
 * pointmill.h: datasets of pointmill for engines and other languages.
 *
 * This file is generated from crates/capi; docs/embedding.md has examples.
 *
 * Rules that hold for every function:
 *
 * - Calls return a PmStatus, 0 for success, unless they cannot fail. pm_last_error() has the text, per thread.
 * - Pointers are not kept after a call. What a call writes to is written after success only, unless it says otherwise.
 * - A pointer to one object may be NULL only where it is said; NULL elsewhere ends in PM_STATUS_ARGUMENT. A pointer has
 *   to be aligned for its type, and a buffer to have the room that is stated: what cannot be checked is the caller's promise.
 * - Buffers that are too small end in PM_STATUS_BUFFER, and nothing is written to them.
 * - Handles belong to the caller until pm_close() or pm_points_free(). A PmDataset can be used by several threads at once.
 * - World coordinates are in the axes of the handle (pm_open()), in the units of the dataset, mostly metres. Double
 *   precision where they are not relative to an origin.
 * - Texts are UTF-8 and end with a 0.
 * - No panic leaves the library: PM_STATUS_INTERNAL instead.
 * - Versions follow SemVer: PM_API_VERSION is 1000 * major + minor.
 */

#ifndef POINTMILL_H
#define POINTMILL_H

#include <stddef.h>
#include <stdint.h>

/*
 No node: the parent of a root.
 */
#define PM_NO_NODE UINT32_MAX

/*
 What is below the node is in a chunk of the hierarchy that was not read yet: pm_load().
 */
#define PM_NODE_PROXY 1

/*
 The node has no children.
 */
#define PM_NODE_LEAF 2

/*
 The node has points of its own: every node of an octree but a proxy, leaves of a binary tree, batches.
 */
#define PM_NODE_DRAWABLE 4

/*
 Most vertices of a mesh whose indices have 16 bits, as engines count: what a window of pm_points_positions() may have.
 */
#define PM_MESH_VERTICES 65000

/*
 The interface that this header describes: 1000 · major + minor. Another major number is another interface; a greater
 minor one has more functions and the same structures. pm_open() refuses what does not fit.
 */
#define PM_API_VERSION 1000

/*
 How a call ended. 0 is success; pm_last_error() then says nothing. Values 1 to 6 are the exit codes of the program.
 */
enum PmStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     Done.
     */
    PM_STATUS_OK = 0,
    /*
     A fault of the library: please report it.
     */
    PM_STATUS_INTERNAL = 1,
    /*
     An argument is NULL, out of range or not a number.
     */
    PM_STATUS_ARGUMENT = 2,
    /*
     The dataset is broken: cut short, corrupt or hostile.
     */
    PM_STATUS_BROKEN = 3,
    /*
     This version does not read it, or a dataset of this kind does not have it.
     */
    PM_STATUS_UNSUPPORTED = 4,
    /*
     The operating system could not read it.
     */
    PM_STATUS_IO = 5,
    /*
     It would take more memory than there is, or than is allowed.
     */
    PM_STATUS_MEMORY = 6,
    /*
     The caller's buffer is too small. Nothing was written to it.
     */
    PM_STATUS_BUFFER = 8,
    /*
     The dataset does not have what was asked for, as colours.
     */
    PM_STATUS_MISSING = 9,
    /*
     The program was compiled for an incompatible version of this interface.
     */
    PM_STATUS_VERSION = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmStatus PmStatus;
#else
typedef uint32_t PmStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The kinds of datasets.
 */
enum PmKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     Potree 2.0, an octree.
     */
    PM_KIND_POTREE2 = 1,
    /*
     Potree 1.4 to 1.8, an octree.
     */
    PM_KIND_POTREE1 = 2,
    /*
     COPC 1.0, an octree.
     */
    PM_KIND_COPC = 3,
    /*
     A binary tree with all points in its leaves.
     */
    PM_KIND_BINTREE = 4,
    /*
     Quantised batches.
     */
    PM_KIND_BATCHES = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmKind PmKind;
#else
typedef uint32_t PmKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The type of an element of an attribute.
 */
enum PmType
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    PM_TYPE_INT8 = 0,
    PM_TYPE_UINT8 = 1,
    PM_TYPE_INT16 = 2,
    PM_TYPE_UINT16 = 3,
    PM_TYPE_INT32 = 4,
    PM_TYPE_UINT32 = 5,
    PM_TYPE_INT64 = 6,
    PM_TYPE_UINT64 = 7,
    PM_TYPE_FLOAT32 = 8,
    PM_TYPE_FLOAT64 = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmType PmType;
#else
typedef uint32_t PmType;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 How the points of a node of a binary tree are drawn.
 */
enum PmMaterial
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     The dataset is no binary tree.
     */
    PM_MATERIAL_NONE = 0,
    /*
     One pixel per point: D_min is beyond the switch distance.
     */
    PM_MATERIAL_FAR = 1,
    /*
     A disc of the point's radius: D_max is before the switch distance.
     */
    PM_MATERIAL_NEAR = 2,
    /*
     Both: two passes, each drops the points of the other side of the switch distance.
     */
    PM_MATERIAL_BOTH = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmMaterial PmMaterial;
#else
typedef uint32_t PmMaterial;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The axes of everything that a handle takes and gives in world coordinates: boxes, positions, cameras, rays, hits.
 Files are z-up. Of a dataset with the coordinates (x, y, z):
 */
enum PmAxes
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     (x, y, z): as in the file, right-handed, z is up.
     */
    PM_AXES_Z_UP = 0,
    /*
     (x, z, -y): right-handed, y is up (OpenGL, glTF, Godot).
     */
    PM_AXES_Y_UP = 1,
    /*
     (x, z, y): left-handed, y is up (Unity).
     */
    PM_AXES_Y_UP_LEFT_HANDED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmAxes PmAxes;
#else
typedef uint32_t PmAxes;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Which octree nodes come first.
 */
enum PmOrder
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     By the radius of the node's sphere in the picture.
     */
    PM_ORDER_RADIUS = 0,
    /*
     By that radius, divided by one plus the angle to the direction of view in radians (Fraiss, "Rendering Large Point
     Clouds in Unity", 2017).
     */
    PM_ORDER_RADIUS_AND_ANGLE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmOrder PmOrder;
#else
typedef uint32_t PmOrder;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 A section of a file of quantised batches.
 */
enum PmSection
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /*
     PmBatchRecord, one per slot.
     */
    PM_SECTION_RECORDS = 0,
    /*
     Words of 32 bits, one per point: bits 29–20 of x, y, z in the box, x lowest.
     */
    PM_SECTION_HI10 = 1,
    /*
     Bits 19–10. Absent from files of 10 bits.
     */
    PM_SECTION_MID10 = 2,
    /*
     Bits 9–0. Absent from files of 10 and 20 bits.
     */
    PM_SECTION_LO10 = 3,
    /*
     Words of 32 bits, one per point: red, green, blue, level of detail, red lowest.
     */
    PM_SECTION_COLOUR = 4,
    /*
     Values of an extra attribute: attribute 0 is number 1 of pm_attribute().
     */
    PM_SECTION_ATTRIBUTE = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PmSection PmSection;
#else
typedef uint32_t PmSection;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 A dataset that is open. Calls may use it from several threads at once; pm_close() must be the last one.
 */
typedef struct PmDataset PmDataset;

/*
 The points of one node, decoded. It lives on when its dataset is closed. Calls may come from several threads; they wait
 for each other, so give each thread its own.
 */
typedef struct PmPoints PmPoints;

/*
 What a validation found.
 */
typedef struct {
    /*
     1: no error was found.
     */
    uint32_t ok;
    /*
     0
     */
    uint32_t reserved;
    /*
     Checks with an error.
     */
    uint64_t failed_checks;
    /*
     Errors, of which at most 20 per check are counted.
     */
    uint64_t errors;
    /*
     Warnings, of which at most 20 per check are counted.
     */
    uint64_t warnings;
    /*
     Points by the metadata.
     */
    uint64_t points;
    /*
     Nodes that were reached from the root; batches.
     */
    uint64_t nodes;
} PmValidation;

/*
 A box: the least and the greatest coordinates, world units, in the axes of the handle.
 */
typedef struct {
    /*
     x, y, z
     */
    double min[3];
    /*
     x, y, z
     */
    double max[3];
} PmBox;

/*
 What is known of a dataset without reading points.
 */
typedef struct {
    /*
     A value of PmKind.
     */
    PmKind kind;
    /*
     1 if the dataset says how many points it has.
     */
    uint32_t has_points;
    /*
     Points of the dataset; 0 if it does not say it.
     */
    uint64_t points;
    /*
     Nodes that are known now: of an octree those of the chunks that were read. Of batches: slots.
     */
    uint32_t nodes;
    /*
     Attributes; positions are not among them.
     */
    uint32_t attributes;
    /*
     The box of the tree: of an octree its cube. All 0 of a dataset without points.
     */
    PmBox bounds;
    /*
     The box of the points, if the dataset says it, else `bounds`.
     */
    PmBox tight;
    /*
     1 if `tight` is the box of the points.
     */
    uint32_t has_tight;
    /*
     1 if there are colours: pm_points_colours() works.
     */
    uint32_t has_colours;
    /*
     Octrees: distance between points in the root, world units; halves with every level. Else 0.
     */
    double spacing;
    /*
     Where the coordinates of the scans lie: whole numbers times `scale` plus `offset`. In the axes of the **file**.
     */
    double scale[3];
    /*
     See `scale`.
     */
    double offset[3];
    /*
     Binary trees: most points of a leaf. Batches: 10,240. Octrees: 0, there is no limit.
     */
    uint64_t node_capacity;
    /*
     Batches: bits of a position on each axis that the file has, 10, 20 or 30. Else 0.
     */
    uint32_t bits;
    /*
     Batches: 1 if sections are compressed, so that they cannot be mapped but are decoded batch by batch.
     */
    uint32_t is_compressed;
    /*
     Batches: what records and decoded words are relative to, in the axes of the **file**. Else 0.
     */
    double grid_origin[3];
    /*
     Batches: side of the cells of the coarsest level of detail, world units. Else 0.
     */
    double grid_cell;
} PmInfo;

/*
 An attribute. The pointers are valid until pm_close().
 */
typedef struct {
    /*
     UTF-8: "intensity", "rgb", "classification", "gps-time", …
     */
    const char *name;
    /*
     A value of PmType.
     */
    PmType element_type;
    /*
     Elements per point, at least 1.
     */
    uint32_t elements;
    /*
     Bytes per point.
     */
    uint32_t size;
    /*
     0
     */
    uint32_t reserved;
    /*
     Least raw value of each element, or NULL if the dataset does not say it. So is `max`.
     */
    const double *min;
    /*
     Greatest raw value of each element, or NULL.
     */
    const double *max;
    /*
     Factor from raw to meant values, for each element.
     */
    const double *scale;
    /*
     Summand from raw to meant values, for each element.
     */
    const double *offset;
} PmAttribute;

/*
 A node. Numbers stay the same as long as the handle is open.
 */
typedef struct {
    /*
     Its number. Octrees and binary trees: the root is 0, further numbers of a binary tree are in preorder. Batches: the
     slot in the file.
     */
    uint32_t id;
    /*
     Number of its parent; PM_NO_NODE of a root and of batches.
     */
    uint32_t parent;
    /*
     0 of a root and of batches.
     */
    uint32_t level;
    /*
     PM_NODE_PROXY, PM_NODE_LEAF, PM_NODE_DRAWABLE.
     */
    uint32_t flags;
    /*
     Points of the node alone; of an inner node of a binary tree: of its leaves; of a proxy: 0.
     */
    uint64_t points;
    /*
     Octrees: the node's cube. Else: the tight box of its points.
     */
    PmBox bounds;
    /*
     Octrees: distance between points in inner nodes of this level, world units. Else 0.
     */
    double spacing;
    /*
     A place in the middle, as an origin for positions in single precision; of a leaf of a binary tree the one that its
     records are relative to.
     */
    double center[3];
} PmNode;

/*
 A ray that is wide enough to meet points, world units, in the axes of the handle: it meets all that lies within
 `radius + spread · distance` of it.
 */
typedef struct {
    /*
     Where it begins.
     */
    double origin[3];
    /*
     Where it goes, of any length > 0.
     */
    double direction[3];
    /*
     Its radius at the origin, ≥ 0.
     */
    double radius;
    /*
     What its radius gains per unit of distance, ≥ 0: for a tolerance of n pixels n · tan(fov / height).
     */
    double spread;
} PmRay;

/*
 A point that a ray met.
 */
typedef struct {
    /*
     Where the point is, in the axes of the handle.
     */
    double position[3];
    /*
     Along the ray from its origin, world units.
     */
    double distance;
    /*
     From the ray, world units.
     */
    double off_ray;
    /*
     Its number among the points of the node, as pm_decode() gives them.
     */
    uint64_t point;
    /*
     The node.
     */
    uint32_t node;
    /*
     1 if a point was met; else nothing of this has a meaning.
     */
    uint32_t found;
} PmHit;

/*
 A perspective camera, world units, in the axes of the handle.
 */
typedef struct {
    /*
     Where it is.
     */
    double eye[3];
    /*
     The direction of view, of any length > 0.
     */
    double forward[3];
    /*
     What is up in the picture, of any length; chosen where it is parallel to `forward`.
     */
    double up[3];
    /*
     Angle between the upper and the lower border of the picture, radians, > 0 and < π.
     */
    double vertical_fov;
    /*
     Nothing nearer is in the picture, ≥ 0.
     */
    double near;
    /*
     Nothing beyond is in the picture; 0: no limit.
     */
    double far;
    /*
     Pixels from left to right, ≥ 1.
     */
    uint32_t width;
    /*
     Pixels from top to bottom, ≥ 1.
     */
    uint32_t height;
} PmCamera;

/*
 How much a picture shows.
 */
typedef struct {
    /*
     Points, at most; the first node is shown whatever the budget is.
     */
    uint64_t budget;
    /*
     Octrees: nodes whose sphere has a smaller radius in the picture, in pixels, are not shown.
     */
    double min_node_pixels;
    /*
     Binary trees: radius of a point near by, world units, > 0: decides the switch distance.
     */
    double point_radius;
    /*
     Octrees: a value of PmOrder.
     */
    uint32_t order;
    /*
     Octrees: 1 reads chunks of the hierarchy as they are needed. 0 reads nothing: proxies in sight are listed with
     PM_NODE_PROXY, for pm_load() on another thread.
     */
    uint32_t load;
} PmSelection;

/*
 A node to draw.
 */
typedef struct {
    /*
     Its number.
     */
    uint32_t node;
    /*
     Octrees: its parent, which stands before it. Else PM_NO_NODE.
     */
    uint32_t parent;
    /*
     Flags of PmNode.
     */
    uint32_t flags;
    /*
     A value of PmMaterial.
     */
    PmMaterial material;
    /*
     Batches: the fewest bits of a position that keep the error within half a pixel, 10, 20 or 30. Else 0.
     */
    uint32_t bits;
    /*
     0
     */
    uint32_t reserved;
    /*
     Its points; 0 of a proxy.
     */
    uint64_t points;
    /*
     From the eye to the nearest point of its box, 0 inside, world units.
     */
    double d_min;
    /*
     From the eye to the farthest corner of its box, world units.
     */
    double d_max;
    /*
     Octrees: radius of its sphere in the picture, pixels; infinite from inside. Else 0.
     */
    double pixels;
} PmDraw;

/*
 A batch as it is in the file and in a structured buffer of a shader: 32 bytes.
 */
typedef struct {
    /*
     Lower corner of the box, relative to PmInfo::grid_origin, axes of the file.
     */
    float min[3];
    /*
     Index of its first point in the sections: 10,240 times the slot.
     */
    uint32_t first_point;
    /*
     Upper corner.
     */
    float max[3];
    /*
     Number of points.
     */
    uint32_t points;
} PmBatchRecord;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Checks the dataset at `path` (UTF-8): that every node decodes, and that boxes, counts, ranges and order are what the
 format promises. Spacing and coverage are not measured: the program does that (`pointmill validate`).

 A dataset that does not conform is not an error of the call: `*result` says it, and `message` the first finding (the
 first error, else the first warning), cut where the buffer ends; empty if there is none. `message` has room for
 `message_capacity` bytes, the 0 at its end included; NULL if that is 0.

 `threads`: 0 is one per core. `memory_bytes`: ceiling of the resident set of the whole process; 0 is 4 GiB. Reads the
 whole dataset. Any thread.
 */
PmStatus pm_validate(const char *path,
                     uint32_t threads,
                     uint64_t memory_bytes,
                     PmValidation *result,
                     char *message,
                     uintptr_t message_capacity);

/*
 Opens the dataset at `path` (UTF-8): a folder, its marker file (metadata.json, cloud.js, index.json), a .qbatch file, a
 COPC file, or an archive with a Potree 1.x dataset. The kind is detected.

 `api_version`: PM_API_VERSION as the program was compiled with. `axes`: a value of PmAxes, for all that the handle takes
 and gives. `*dataset` is the caller's and ends with pm_close(); it is NULL after an error.

 Reads the metadata; of an octree the first chunk of the hierarchy, of a binary tree the index (about 110 bytes of
 memory per node). Quantised batches are mapped: a file that another program cuts short meanwhile ends this one with
 a signal (SIGBUS) when a lost page is touched.
 */
PmStatus pm_open(uint32_t api_version,
                 const char *path,
                 uint32_t axes,
                 PmDataset **dataset);

/*
 Closes a dataset: its handle, its texts and its mapped sections are gone; PmPoints live on. NULL does nothing. Closing a
 handle twice, or while another thread uses it, is an error that cannot be detected.
 */
void pm_close(PmDataset *dataset);

/*
 The number of the interface that the library has: PM_API_VERSION of its header. Any thread.
 */
uint32_t pm_api_version(void);

/*
 The version of the library: "0.1.0". The text lives as long as the library. Any thread.
 */
const char *pm_version(void);

/*
 Batches: the weight of the point with storage index `index` (PmBatchRecord::first_point plus its number in the batch), in
 [0, 1): spreads the transition between levels. The same number as shaders compute. Any thread.
 */
float pm_clod_weight(uint32_t index);

/*
 Batches: the spacing that the picture wants of points at `distance` from the eye, world units. `clod`: the factor of the method;
 1 is fine, more is fewer points. `ndc_radius`: distance from the middle of the picture in normalised device coordinates, ≥ 0.
 (Schütz, Krösl, Wimmer 2019.) Any thread.
 */
float pm_clod_spacing(float distance,
                      float clod,
                      float ndc_radius);

/*
 Batches: 1 if a point of level `level` (the top byte of its colour word) with that weight is drawn where the picture wants points
 `spacing` apart, else 0. `cell`: PmInfo::grid_cell. Any thread.
 */
uint32_t pm_clod_keeps(uint32_t level,
                       float weight,
                       float cell,
                       float spacing);

/*
 Batches: how many levels of a batch whose nearest point is `d_min` away (PmDraw::d_min) the picture can show, 0 to 4: points of
 the others need not be loaded. `clod` and `cell` as above. Any thread.
 */
uint32_t pm_clod_levels(double d_min,
                        float clod,
                        float cell);

/*
 What is known of the dataset without reading points.

 `*info` is overwritten. Any thread.
 */
PmStatus pm_info(const PmDataset *dataset, PmInfo *info);

/*
 The format for people: "Potree 2.0". The text is valid until pm_close(); NULL of NULL. Any thread.
 */
const char *pm_format(const PmDataset *dataset);

/*
 The coordinate reference system as the dataset has it: mostly a proj4 definition, empty if it names none. The text is
 valid until pm_close(); NULL of NULL. Any thread.
 */
const char *pm_projection(const PmDataset *dataset);

/*
 Attribute `index` of PmInfo::attributes. Its index is what pm_points_attribute() takes.

 Of batches the first is "colour": words of red, green, blue and level of detail, the lowest byte first. Of binary trees
 it is "classification", a float.

 `*attribute` is overwritten; its pointers are valid until pm_close(). Any thread.
 */
PmStatus pm_attribute(const PmDataset *dataset, uint32_t index, PmAttribute *attribute);

/*
 Node `id`. Of Potree 1.x this may look at the size of the node's file.

 `*node` is overwritten. Any thread.
 */
PmStatus pm_node(const PmDataset *dataset, uint32_t id, PmNode *node);

/*
 The nodes from number `first` on, in the order of their numbers: `count` of them into `nodes`, which has room for as
 many. PmInfo::nodes says how many are known. Any thread.
 */
PmStatus pm_nodes(const PmDataset *dataset, uint32_t first, uint32_t count, PmNode *nodes);

/*
 The children of node `id` that are known: their numbers in `children`, which has room for 8, and in `*count` how many
 these are (a binary tree: 0 or 2, the low side first; batches: 0; a proxy: 0). Any thread.
 */
PmStatus pm_children(const PmDataset *dataset, uint32_t id, uint32_t *children, uint32_t *count);

/*
 The name of node `id`: "r042" of an octree, "n0101" of a binary tree, the slot of a batch; UTF-8 with a 0 at its end,
 in `name`, which has room for `capacity` bytes. 520 are always enough. Any thread.
 */
PmStatus pm_node_name(const PmDataset *dataset, uint32_t id, char *name, uintptr_t capacity);

/*
 Octrees: if node `id` is a proxy, reads its chunk of the hierarchy, so that it and nodes below it become known. Does
 nothing for other nodes and other kinds of datasets.

 `*added`: how many nodes became known, at the end of the list; may be NULL. Reads from the disk; other threads can use
 the handle meanwhile. Any thread.
 */
PmStatus pm_load(const PmDataset *dataset, uint32_t id, uint32_t *added);

/*
 Octrees: reads all chunks of the hierarchy. Ends with PM_STATUS_MEMORY when more than `most_nodes` are known (about
 150 bytes each). Does nothing for other kinds. Any thread.
 */
PmStatus pm_load_all(const PmDataset *dataset, uint32_t most_nodes);

/*
 D_min and D_max of node `id`: the distances from `eye` to the nearest point of its box (0 inside) and to its
 farthest corner, world units. `eye`: 3 doubles. Any thread.
 */
PmStatus pm_distances(const PmDataset *dataset, uint32_t id, const double *eye, double *d_min, double *d_max);

/*
 The point that `ray` meets first: of those within its width the one of the least distance along it; of several, the one
 nearest to the ray, then the one of the lowest node and point. All points of the dataset count, drawn or not.

 `*hit` is overwritten; PmHit::found says whether there is one. Boxes are visited in the order in which the ray enters
 them. Leaves of a binary tree are kept in memory from pick to pick (64 MB); of octrees and batches what the ray enters
 is decoded each time, some milliseconds per node: for a click, not for each frame. Any thread; picks of a binary tree
 wait for each other.
 */
PmStatus pm_pick(const PmDataset *dataset, const PmRay *ray, PmHit *hit);

/*
 A place for decoded points, to be used for node after node: its memory is reused.

 `*points` is the caller's and ends with pm_points_free(). Any thread.
 */
PmStatus pm_points_new(PmPoints **points);

/*
 Ends a place for points. NULL does nothing. Ending it twice, or while another thread uses it, is an error that cannot be
 detected.
 */
void pm_points_free(PmPoints *points);

/*
 Decodes the points of node `id` in place of those that are there; after an error there are none.

 A node of an octree (a proxy: PM_STATUS_MISSING), a leaf of a binary tree (an inner node: PM_STATUS_UNSUPPORTED), or a
 batch. `bits` of a position on each axis, for batches: 10, 20 or 30, or 0 for all that the file has; others ignore it.

 `*count`: how many points there are; may be NULL. Reads from the disk; takes a lock on `points`, none on `dataset`.
 */
PmStatus pm_decode(const PmDataset *dataset, uint32_t id, uint32_t bits, const PmPoints *points, uintptr_t *count);

/*
 `*count`: how many points there are.
 */
PmStatus pm_points_count(const PmPoints *points, uintptr_t *count);

/*
 Positions of the `count` points from number `first` on, as stored: x, y, z in single precision **relative to `origin`**
 (3 doubles, in the axes of the handle; NULL is 0, 0, 0), world units. The difference is computed in double precision
 and then rounded, so with an origin near by (PmNode::center) nothing is lost that single precision can hold.

 A mesh with at most PM_MESH_VERTICES vertices takes windows of as many points: `first` 0, then 65,000, …

 `out` has room for `capacity` floats, 3 · `count` at least.
 */
PmStatus pm_points_positions(const PmPoints *points,
                             uintptr_t first,
                             uintptr_t count,
                             const double *origin,
                             float *out,
                             uintptr_t capacity);

/*
 As pm_points_positions(), in double precision and not relative to anything: exactly what was decoded.
 */
PmStatus pm_points_world(const PmPoints *points, uintptr_t first, uintptr_t count, double *out, uintptr_t capacity);

/*
 Colours of the `count` points from number `first` on: red, green, blue and alpha (255), a byte each. PM_STATUS_MISSING
 if the dataset has none (PmInfo::has_colours).

 Colours of 16 bits become the nearest of 8 (v · 255 / 65535, rounded), unless no value of the dataset, or of a sample
 where it does not say its range, is above 255: then they are 8 bits already.

 `out` has room for `capacity` bytes, 4 · `count` at least.
 */
PmStatus pm_points_colours(const PmPoints *points, uintptr_t first, uintptr_t count, uint8_t *out, uintptr_t capacity);

/*
 Raw values of attribute `index` (as pm_attribute() counts) of the `count` points from number `first` on: little-endian
 elements of PmAttribute::element_type, those of a point side by side.

 `out` has room for `capacity` bytes, PmAttribute::size · `count` at least; it need not be aligned.
 */
PmStatus pm_points_attribute(const PmPoints *points,
                             uint32_t index,
                             uintptr_t first,
                             uintptr_t count,
                             void *out,
                             uintptr_t capacity);

/*
 As pm_points_attribute(), as doubles, and as they are meant: raw · scale + offset. Whole numbers above 2^53 are rounded.

 `out` has room for `capacity` doubles, PmAttribute::elements · `count` at least.
 */
PmStatus pm_points_values(const PmPoints *points,
                          uint32_t index,
                          uintptr_t first,
                          uintptr_t count,
                          double *out,
                          uintptr_t capacity);

/*
 A section of the mapped file, without a copy: `*data` and its length in `*bytes`. In the axes of the file, little-endian.

 `section`: a value of PmSection. `attribute`: of PM_SECTION_ATTRIBUTE the number among the extra attributes; else it is
 ignored. The memory belongs to the handle, may only be read, and is gone after pm_close(). PM_STATUS_UNSUPPORTED if the
 file does not have the section, or has it compressed (pm_batch_section() decodes it then). Any thread.
 */
PmStatus pm_section(const PmDataset *dataset,
                    uint32_t section,
                    uint32_t attribute,
                    const void **data,
                    uintptr_t *bytes);

/*
 The values of one batch, as in pm_section(), copied to `out`; of compressed files, too. `*bytes`: how many there are.
 4 bytes per point but for attributes.

 `out` has room for `capacity` bytes; it need not be aligned. Any thread.
 */
PmStatus pm_batch_section(const PmDataset *dataset,
                          uint32_t slot,
                          uint32_t section,
                          uint32_t attribute,
                          void *out,
                          uintptr_t capacity,
                          uintptr_t *bytes);

/*
 What a picture shows of the dataset:

 - Of an octree the nodes in sight that are large in it, the most urgent first, each behind its parent, until one does not
   fit the budget any more: the traversal of viewers.
 - Of a binary tree the leaves in sight with their material by D_min and D_max, the nearest first, until one does not fit.
 - Of batches those in sight with the bits that they need, the nearest first, until one does not fit.

 `*count`: how many there are; `list` has room for `capacity` of them. If that is too small, PM_STATUS_BUFFER, `*count`
 is set and nothing else is written; PmInfo::nodes are always enough where no chunk is read. The same arguments give the
 same list. May read the hierarchy from the disk (PmSelection::load). Any thread.
 */
PmStatus pm_select(const PmDataset *dataset,
                   const PmCamera *camera,
                   const PmSelection *selection,
                   PmDraw *list,
                   uintptr_t capacity,
                   uintptr_t *count);

/*
 The distance at which points change from discs to single pixels: radius / tan(fov / height). `point_radius`: world
 units, > 0. `vertical_fov`: radians. `height`: pixels. (Santana et al. 2019.) Any thread.
 */
PmStatus pm_switch_distance(double point_radius, double vertical_fov, double height, double *distance);

/*
 The material of a box that lies between `d_min` and `d_max` from the eye (pm_distances()): PM_MATERIAL_FAR,
 PM_MATERIAL_NEAR or PM_MATERIAL_BOTH. Any thread.
 */
PmMaterial pm_material(double d_min, double d_max, double switch_distance);

/*
 The error of the last call on this thread that returns a status: one line of UTF-8 that says what, where and what to do.
 Empty after success, never NULL.

 The text belongs to the library and is valid until the next call on this thread. Any thread.
 */
const char *pm_last_error(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* POINTMILL_H */
