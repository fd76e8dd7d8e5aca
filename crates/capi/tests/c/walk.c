/* Prints every figure of a dataset that the interface gives: walk PATH AXES. The test computes the same in Rust. */

#include <pointmill.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(PmStatus status, const char *what) {
    if (status != PM_STATUS_OK) {
        fprintf(stderr, "%s: status %u: %s\n", what, (unsigned)status, pm_last_error());
        exit(1);
    }
}

static void *memory(size_t bytes) {
    void *found = malloc(bytes ? bytes : 1);
    if (!found) exit(1);
    return found;
}

static void print_box(const PmBox *box) {
    for (int a = 0; a < 3; a++) printf(" %.17g %.17g", box->min[a], box->max[a]);
}

/* A sum in which the order of bytes counts. */
static unsigned long long sum_bytes(const unsigned char *bytes, size_t count) {
    unsigned long long sum = 0;
    for (size_t i = 0; i < count; i++) sum += bytes[i] * (unsigned long long)(i % 251 + 1);
    return sum;
}

static void print_info(const PmDataset *dataset, const PmInfo *info) {
    printf("info %u %llu %u %u %u", (unsigned)info->kind, (unsigned long long)info->points, info->nodes, info->attributes,
           info->has_colours);
    print_box(&info->bounds);
    print_box(&info->tight);
    printf(" %.17g %.17g %.17g %llu %u\n", info->spacing, info->scale[0], info->offset[0],
           (unsigned long long)info->node_capacity, info->bits);
    printf("projection [%s]\n", pm_projection(dataset));
    for (uint32_t i = 0; i < info->attributes; i++) {
        PmAttribute attribute;
        check(pm_attribute(dataset, i, &attribute), "pm_attribute");
        printf("attribute [%s] %u %u %u", attribute.name, (unsigned)attribute.element_type, attribute.elements, attribute.size);
        for (uint32_t e = 0; attribute.min && e < attribute.elements; e++)
            printf(" %.17g %.17g", attribute.min[e], attribute.max[e]);
        printf("\n");
    }
}

static void print_points(const PmNode *node, const PmInfo *info, const PmPoints *points, size_t count) {
    float *positions = memory(3 * count * sizeof(float));
    double *world = memory(3 * count * sizeof(double));
    double sums[6] = {0};
    size_t half = count / 2; /* two windows */
    check(pm_points_positions(points, 0, half, node->center, positions, 3 * half), "pm_points_positions");
    check(pm_points_positions(points, half, count - half, node->center, positions + 3 * half, 3 * (count - half)), "window");
    check(pm_points_world(points, 0, count, world, 3 * count), "pm_points_world");
    for (size_t i = 0; i < 3 * count; i++) {
        sums[i % 3] += positions[i];
        sums[3 + i % 3] += world[i];
    }
    printf("points %u %zu", node->id, count);
    for (int i = 0; i < 6; i++) printf(" %.17g", sums[i]);
    if (info->has_colours) {
        unsigned char *colours = memory(4 * count);
        check(pm_points_colours(points, 0, count, colours, 4 * count), "pm_points_colours");
        printf(" %llu", sum_bytes(colours, 4 * count));
        free(colours);
    }
    printf("\n");
    free(positions);
    free(world);
}

static void print_attributes(const PmDataset *dataset, const PmInfo *info, const PmPoints *points, size_t count) {
    for (uint32_t a = 0; a < info->attributes; a++) {
        PmAttribute attribute;
        check(pm_attribute(dataset, a, &attribute), "pm_attribute");
        size_t bytes = attribute.size * count, values = attribute.elements * count;
        unsigned char *raw = memory(bytes);
        double *meant = memory(values * sizeof(double)), sum = 0;
        check(pm_points_attribute(points, a, 0, count, raw, bytes), "pm_points_attribute");
        check(pm_points_values(points, a, 0, count, meant, values), "pm_points_values");
        for (size_t i = 0; i < values; i++) sum += meant[i];
        printf("values %u %llu %.17g\n", a, sum_bytes(raw, bytes), sum);
        free(raw);
        free(meant);
    }
}

static void print_nodes(const PmDataset *dataset, const PmInfo *info) {
    PmNode *nodes = memory(info->nodes * sizeof(PmNode));
    PmPoints *points;
    check(pm_points_new(&points), "pm_points_new");
    check(pm_nodes(dataset, 0, info->nodes, nodes), "pm_nodes");
    for (uint32_t id = 0; id < info->nodes; id++) {
        PmNode one, *node = &nodes[id];
        char name[520];
        uint32_t children[8], count;
        check(pm_node(dataset, id, &one), "pm_node");
        if (one.id != node->id || one.points != node->points) exit(2);
        check(pm_node_name(dataset, id, name, sizeof name), "pm_node_name");
        check(pm_children(dataset, id, children, &count), "pm_children");
        printf("node %u [%s] %u %u %u %llu", node->id, name, node->parent, node->level, node->flags,
               (unsigned long long)node->points);
        print_box(&node->bounds);
        for (uint32_t i = 0; i < count; i++) printf(" %u", children[i]);
        printf("\n");
        if (node->flags & PM_NODE_DRAWABLE) {
            size_t decoded;
            check(pm_decode(dataset, id, 0, points, &decoded), "pm_decode");
            print_points(node, info, points, decoded);
            print_attributes(dataset, info, points, decoded);
        }
    }
    pm_points_free(points);
    free(nodes);
}

static void print_sections(const PmDataset *dataset, const PmInfo *info) {
    if (info->kind != PM_KIND_BATCHES) return;
    for (uint32_t section = PM_SECTION_RECORDS; section <= PM_SECTION_ATTRIBUTE; section++) {
        const void *data = NULL;
        size_t bytes = 0, slot_bytes = 0, total = 0;
        PmStatus status = pm_section(dataset, section, 0, &data, &bytes);
        printf("section %u %u", section, (unsigned)status);
        if (status == PM_STATUS_OK) printf(" %zu %llu", bytes, sum_bytes(data, bytes));
        for (uint32_t slot = 0; slot < info->nodes; slot++) {
            unsigned char values[10240 * 8];
            if (pm_batch_section(dataset, slot, section, 0, values, sizeof values, &slot_bytes) == PM_STATUS_OK)
                total += slot_bytes;
        }
        printf(" %zu\n", total);
    }
}

/* From the south of the tight box (of the z-up axes) to its middle. */
static PmCamera camera_of(const PmInfo *info, uint32_t axes) {
    PmCamera camera;
    double size = 0;
    memset(&camera, 0, sizeof camera);
    for (int a = 0; a < 3; a++) {
        camera.eye[a] = (info->tight.min[a] + info->tight.max[a]) / 2;
        if (info->tight.max[a] - info->tight.min[a] > size) size = info->tight.max[a] - info->tight.min[a];
    }
    if (axes == PM_AXES_Z_UP) {
        camera.eye[1] -= 1.5 * size;
        camera.forward[1] = 1;
        camera.up[2] = 1;
    } else {
        double south = axes == PM_AXES_Y_UP ? 1 : -1;
        camera.eye[2] += south * 1.5 * size;
        camera.forward[2] = -south;
        camera.up[1] = 1;
    }
    camera.vertical_fov = 1.0;
    camera.width = 1600;
    camera.height = 900;
    return camera;
}

static void print_selection(const PmDataset *dataset, const PmInfo *info, uint32_t axes) {
    PmCamera camera = camera_of(info, axes);
    PmSelection selection;
    size_t count = 0;
    memset(&selection, 0, sizeof selection);
    selection.budget = info->points / 2;
    selection.point_radius = 0.05;
    selection.order = PM_ORDER_RADIUS_AND_ANGLE;
    selection.load = 1;
    PmStatus status = pm_select(dataset, &camera, &selection, NULL, 0, &count);
    if (status != PM_STATUS_BUFFER && count > 0) exit(3);
    PmDraw *list = memory(count * sizeof(PmDraw));
    check(pm_select(dataset, &camera, &selection, list, count, &count), "pm_select");
    for (size_t i = 0; i < count; i++) {
        double d_min, d_max;
        check(pm_distances(dataset, list[i].node, camera.eye, &d_min, &d_max), "pm_distances");
        if (d_min != list[i].d_min || d_max != list[i].d_max) exit(4);
        printf("draw %u %u %u %u %llu %.17g %.17g %.17g\n", list[i].node, list[i].parent, (unsigned)list[i].material,
               list[i].bits, (unsigned long long)list[i].points, d_min, d_max, list[i].pixels);
    }
    free(list);
}

/* A ray from above (along the file's z) to the first point of the first drawable node. */
static void print_pick(const PmDataset *dataset, const PmInfo *info, uint32_t axes) {
    PmRay ray;
    PmHit hit;
    PmPoints *points;
    double world[3];
    int up = axes == PM_AXES_Z_UP ? 2 : 1;
    memset(&ray, 0, sizeof ray);
    check(pm_points_new(&points), "pm_points_new");
    for (uint32_t id = 0; id < info->nodes; id++) {
        size_t count = 0;
        if (pm_decode(dataset, id, 0, points, &count) != PM_STATUS_OK || count == 0) continue;
        check(pm_points_world(points, 0, 1, world, 3), "pm_points_world");
        memcpy(ray.origin, world, sizeof world);
        ray.origin[up] += 1000;
        ray.direction[up] = -2;
        ray.radius = 0.01;
        check(pm_pick(dataset, &ray, &hit), "pm_pick");
        printf("hit %u %u %llu %.17g %.17g %.17g %.17g %.17g\n", hit.found, hit.node, (unsigned long long)hit.point,
               hit.position[0], hit.position[1], hit.position[2], hit.distance, hit.off_ray);
        break;
    }
    pm_points_free(points);
}

int main(int argc, char **argv) {
    PmDataset *dataset;
    PmInfo info;
    if (argc != 3) return 5;
    uint32_t axes = (uint32_t)atoi(argv[2]);
    check(pm_open(PM_API_VERSION, argv[1], axes, &dataset), "pm_open");
    check(pm_load_all(dataset, 100000), "pm_load_all");
    check(pm_info(dataset, &info), "pm_info");
    print_info(dataset, &info);
    print_nodes(dataset, &info);
    print_sections(dataset, &info);
    print_selection(dataset, &info, axes);
    print_pick(dataset, &info, axes);
    pm_close(dataset);
    return 0;
}
