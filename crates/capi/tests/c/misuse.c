/* Mistakes end in a status and a line; threads share a handle: misuse DATASET FOREIGN_FILE BROKEN_DATASET. */

#include <pointmill.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures;

static void expect(const char *what, PmStatus found, PmStatus expected) {
    int has_text = pm_last_error()[0] != 0;
    if (found != expected || has_text != (expected != PM_STATUS_OK)) {
        printf("%s: status %u, not %u: [%s]\n", what, (unsigned)found, (unsigned)expected, pm_last_error());
        failures++;
    }
}

#define EXPECT(expected, call) expect(#call, call, expected)

static void nulls(void) {
    PmDataset *dataset = (PmDataset *)1;
    PmPoints *points;
    size_t count;
    EXPECT(PM_STATUS_ARGUMENT, pm_open(PM_API_VERSION, NULL, PM_AXES_Z_UP, &dataset));
    if (dataset) failures++;
    EXPECT(PM_STATUS_ARGUMENT, pm_open(PM_API_VERSION, "x", PM_AXES_Z_UP, NULL));
    EXPECT(PM_STATUS_VERSION, pm_open(PM_API_VERSION + 1000, "x", PM_AXES_Z_UP, &dataset));
    EXPECT(PM_STATUS_ARGUMENT, pm_open(PM_API_VERSION, "\xff\xfe", PM_AXES_Z_UP, &dataset));
    EXPECT(PM_STATUS_ARGUMENT, pm_info(NULL, NULL));
    EXPECT(PM_STATUS_ARGUMENT, pm_select(NULL, NULL, NULL, NULL, 0, &count));
    EXPECT(PM_STATUS_ARGUMENT, pm_pick(NULL, NULL, NULL));
    EXPECT(PM_STATUS_ARGUMENT, pm_load(NULL, 0, NULL));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_new(NULL));
    EXPECT(PM_STATUS_OK, pm_points_new(&points));
    EXPECT(PM_STATUS_ARGUMENT, pm_decode(NULL, 0, 0, points, NULL));
    EXPECT(PM_STATUS_OK, pm_points_count(points, &count));
    pm_points_free(points);
    pm_points_free(NULL);
    pm_close(NULL);
}

static void wrong_sizes(const PmDataset *dataset) {
    PmPoints *points;
    size_t count;
    float floats[3] = {7, 7, 7};
    char name[1];
    uint32_t children[8], number;
    PmNode node;
    EXPECT(PM_STATUS_ARGUMENT, pm_node(dataset, 100000, &node));
    EXPECT(PM_STATUS_ARGUMENT, pm_nodes(dataset, 0, 100000, &node));
    EXPECT(PM_STATUS_ARGUMENT, pm_children(dataset, 100000, children, &number));
    EXPECT(PM_STATUS_BUFFER, pm_node_name(dataset, 0, name, 1));
    EXPECT(PM_STATUS_ARGUMENT, pm_node_name(dataset, 0, NULL, 9));
    EXPECT(PM_STATUS_OK, pm_points_new(&points));
    EXPECT(PM_STATUS_OK, pm_decode(dataset, 0, 0, points, &count));
    EXPECT(PM_STATUS_BUFFER, pm_points_positions(points, 0, 2, NULL, floats, 3));
    if (floats[0] != 7 || count < 2) failures++;
    EXPECT(PM_STATUS_OK, pm_points_positions(points, 1, 1, NULL, floats, 3));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_positions(points, count, 1, NULL, floats, 3));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_positions(points, SIZE_MAX, 2, NULL, floats, 3));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_positions(points, 0, 1, NULL, NULL, 3));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_positions(points, 0, 1, NULL, (float *)((char *)floats + 1), 2));
    EXPECT(PM_STATUS_ARGUMENT, pm_points_attribute(points, 99, 0, 1, floats, 12));
    EXPECT(PM_STATUS_BUFFER, pm_points_colours(points, 0, 1, (uint8_t *)floats, 3));
    EXPECT(PM_STATUS_ARGUMENT, pm_decode(dataset, 100000, 0, points, &count));
    EXPECT(PM_STATUS_OK, pm_points_count(points, &count));
    if (count != 0) failures++; /* after an error there are none */
    EXPECT(PM_STATUS_UNSUPPORTED, pm_section(dataset, PM_SECTION_HI10, 0, NULL, NULL));
    pm_points_free(points);
}

static void numbers(const PmDataset *dataset) {
    PmRay ray;
    PmHit hit;
    PmCamera camera;
    PmSelection selection;
    size_t count;
    double distance;
    memset(&ray, 0, sizeof ray);
    memset(&camera, 0, sizeof camera);
    memset(&selection, 0, sizeof selection);
    EXPECT(PM_STATUS_ARGUMENT, pm_pick(dataset, &ray, &hit));
    EXPECT(PM_STATUS_ARGUMENT, pm_select(dataset, &camera, &selection, NULL, 0, &count));
    EXPECT(PM_STATUS_ARGUMENT, pm_switch_distance(0, 1, 1, &distance));
    EXPECT(PM_STATUS_OK, pm_switch_distance(0.05, 1.0471975511965976, 1080, &distance));
    if (distance < 51.56 || distance > 51.57) failures++;
    if (pm_material(1, 2, 3) != PM_MATERIAL_NEAR || pm_material(4, 5, 3) != PM_MATERIAL_FAR) failures++;
    if (pm_material(2, 4, 3) != PM_MATERIAL_BOTH) failures++;
}

static void validations(const char *sound, const char *broken) {
    PmValidation found;
    char message[40];
    EXPECT(PM_STATUS_OK, pm_validate(sound, 1, 0, &found, message, sizeof message));
    if (!found.ok || found.errors) failures++;
    EXPECT(PM_STATUS_OK, pm_validate(broken, 1, 0, &found, message, sizeof message));
    if (found.ok || !found.errors || !message[0] || strlen(message) >= sizeof message) failures++;
    EXPECT(PM_STATUS_OK, pm_validate(broken, 1, 0, &found, NULL, 0));
    EXPECT(PM_STATUS_ARGUMENT, pm_validate(NULL, 1, 0, &found, NULL, 0));
    EXPECT(PM_STATUS_ARGUMENT, pm_validate(sound, 1, 0, NULL, NULL, 0));
}

/* Each thread decodes all nodes in its own place, and fails once in its own way. */
static void *work(void *argument) {
    const PmDataset *dataset = argument;
    PmPoints *points;
    PmInfo info;
    size_t total = 0, count;
    if (pm_points_new(&points) || pm_load_all(dataset, 100000) || pm_info(dataset, &info)) return (void *)1;
    for (int round = 0; round < 3; round++)
        for (uint32_t id = 0; id < info.nodes; id++) {
            if (pm_decode(dataset, id, 0, points, &count)) return (void *)2;
            total += count;
        }
    if (total != 3 * info.points) return (void *)3;
    if (pm_node(dataset, 100000, NULL) != PM_STATUS_ARGUMENT || !strstr(pm_last_error(), "node 100000")) return (void *)4;
    pm_points_free(points);
    return NULL;
}

static void threads(PmDataset *dataset) {
    pthread_t all[4];
    void *result;
    for (int i = 0; i < 4; i++)
        if (pthread_create(&all[i], NULL, work, dataset)) exit(6);
    for (int i = 0; i < 4; i++) {
        pthread_join(all[i], &result);
        if (result) printf("thread %d: %d\n", i, (int)(size_t)result), failures++;
    }
}

int main(int argc, char **argv) {
    PmDataset *dataset, *other;
    if (argc != 4) return 5;
    nulls();
    EXPECT(PM_STATUS_UNSUPPORTED, pm_open(PM_API_VERSION, argv[2], PM_AXES_Z_UP, &other));
    EXPECT(PM_STATUS_IO, pm_open(PM_API_VERSION, "there/is/nothing", PM_AXES_Z_UP, &other));
    EXPECT(PM_STATUS_ARGUMENT, pm_open(PM_API_VERSION, argv[1], 3, &other));
    EXPECT(PM_STATUS_OK, pm_open(PM_API_VERSION, argv[1], PM_AXES_Z_UP, &dataset));
    wrong_sizes(dataset);
    numbers(dataset);
    validations(argv[1], argv[3]);
    threads(dataset);
    pm_close(dataset);
    return failures ? 1 : 0;
}
