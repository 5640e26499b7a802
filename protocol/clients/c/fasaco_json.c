/* Messages as JSON, a line for each: from standard input, or a pose to standard output.
 *
 *   fasaco_json < messages          prints what it reads
 *   fasaco_json pose map 1.5 -2 0   writes a geometry_msgs/PoseStamped: x, y [m], yaw [rad]
 *
 * A message comes as a line "<type> <size>" and then so many bytes; <type> is as in the Zenoh
 * encoding, behind "application/cdr;". What is refused is printed as {"error": "..."}. A
 * message of type "json" is printed as it is. ../bridge.py sends a live robot's messages so.
 *
 * Build: cc -std=c11 -O2 -Wall -Wextra -Werror -o fasaco_json fasaco_json.c fasaco_cdr.c -lm
 */
#include "fasaco_cdr.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { NAME_BYTES = 128, MAX_PAYLOAD = 128 << 20 };

static void print_text(const char *text, size_t size)
{
    putchar('"');
    for (size_t i = 0; i < size; i++) {
        unsigned char letter = (unsigned char)text[i];
        if (letter < 0x20 || letter == 0x7f)
            printf("\\u%04x", letter);
        else if (letter == '"' || letter == '\\')
            printf("\\%c", letter);
        else
            putchar(letter);
    }
    putchar('"');
}

static void print_string(const char *name, const char *text, size_t size)
{
    printf("\"%s\": ", name);
    print_text(text, size);
}

static int64_t stamp_ns(const fasaco_header *header)
{
    return (int64_t)header->sec * 1000000000 + (int64_t)header->nanosec;
}

static void print_header(const fasaco_header *header)
{
    print_string("frame", header->frame.text, header->frame.size);
    printf(", \"stamp_ns\": %" PRId64, stamp_ns(header));
}

static void print_geometry(const fasaco_geometry *geometry)
{
    printf(", \"rows\": %" PRIu32 ", \"cols\": %" PRIu32 ", \"resolution\": %.17g", geometry->rows,
           geometry->cols, geometry->resolution);
    printf(", \"origin\": [%.17g, %.17g, %.17g]", geometry->origin.x, geometry->origin.y,
           geometry->origin.yaw);
}

/* Cells of one byte, signed or not: the caller says which byte means what. */
static void print_cells(const char *name, const uint8_t *cells, bool is_signed, uint32_t rows,
                        uint32_t cols)
{
    printf(", \"%s\": [", name);
    for (size_t row = 0; row < rows; row++) {
        printf(row ? ", [" : "[");
        for (size_t col = 0; col < cols; col++) {
            uint8_t cell = cells[row * cols + col];
            printf(col ? ", %d" : "%d", is_signed ? (int)(int8_t)cell : (int)cell);
        }
        putchar(']');
    }
    putchar(']');
}

static bool print_pose(const fasaco_pose_stamped *pose)
{
    print_header(&pose->header);
    printf(", \"pose\": [%.17g, %.17g, %.17g]", pose->pose.x, pose->pose.y, pose->pose.yaw);
    return true;
}

static bool show_pose_stamped(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_pose_stamped pose;
    return fasaco_read_pose_stamped(payload, size, &pose, error) && print_pose(&pose);
}

static bool show_pose_with_covariance(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_pose_stamped pose;
    return fasaco_read_pose_with_covariance_stamped(payload, size, &pose, error) &&
           print_pose(&pose);
}

static bool show_odometry(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_pose_stamped pose;
    return fasaco_read_odometry(payload, size, &pose, error) && print_pose(&pose);
}

static bool print_twist(const fasaco_twist *twist)
{
    print_header(&twist->header);
    printf(", \"twist\": [%.17g, %.17g]", twist->speed, twist->turn_rate);
    return true;
}

static bool show_twist(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_twist twist;
    return fasaco_read_twist(payload, size, &twist, error) && print_twist(&twist);
}

static bool show_twist_stamped(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_twist twist;
    return fasaco_read_twist_stamped(payload, size, &twist, error) && print_twist(&twist);
}

static bool show_battery(const uint8_t *payload, size_t size, fasaco_error *error)
{
    static const char *const POWERS[] = {"unknown", "charging", "discharging", "not charging",
                                         "full"};
    fasaco_battery battery;
    if (!fasaco_read_battery(payload, size, &battery, error))
        return false;
    print_header(&battery.header);
    if (isnan(battery.level))
        printf(", \"level\": null");
    else
        printf(", \"level\": %.17g", (double)battery.level);
    printf(", \"power\": \"%s\"", POWERS[battery.power]);
    return true;
}

static bool show_scan(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_scan scan;
    if (!fasaco_read_scan(payload, size, &scan, error))
        return false;
    print_header(&scan.header);
    printf(", \"first_rad\": %.17g, \"step_rad\": %.17g, \"least_m\": %.17g, \"most_m\": %.17g",
           (double)scan.first, (double)scan.step, (double)scan.least, (double)scan.most);
    printf(", \"ranges\": [");
    for (uint32_t i = 0; i < scan.count; i++) {
        double range = (double)fasaco_range(&scan, i);
        if (isfinite(range))
            printf(i ? ", %.17g" : "%.17g", range);
        else
            printf(i ? ", null" : "null");
    }
    putchar(']');
    return true;
}

static bool show_grid(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_grid grid;
    if (!fasaco_read_grid(payload, size, &grid, error))
        return false;
    print_header(&grid.header);
    print_geometry(&grid.geometry);
    print_cells("cells", (const uint8_t *)grid.cells, true, grid.geometry.rows,
                grid.geometry.cols);
    return true;
}

static bool show_grid_update(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_grid_update update;
    if (!fasaco_read_grid_update(payload, size, &update, error))
        return false;
    print_header(&update.header);
    printf(", \"row\": %" PRId32 ", \"col\": %" PRId32, update.row, update.col);
    print_cells("cells", (const uint8_t *)update.cells, true, update.rows, update.cols);
    return true;
}

static bool show_pheromone_grid(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_pheromone_grid grid;
    if (!fasaco_read_pheromone_grid(payload, size, &grid, error))
        return false;
    print_header(&grid.header);
    print_geometry(&grid.geometry);
    printf(", \"cohort\": %" PRIu32 ", \"velocity\": %" PRIu32, grid.cohort, grid.velocity);
    printf(", \"ants\": %" PRIu32 ", \"best_steps\": %" PRIu32, grid.ants, grid.best_steps);
    printf(", \"trail_min\": %.17g, \"trail_max\": %.17g", (double)grid.trail_min,
           (double)grid.trail_max);
    print_cells("levels", grid.levels, false, grid.geometry.rows, grid.geometry.cols);
    return true;
}

static bool show_path(const uint8_t *payload, size_t size, fasaco_error *error)
{
    fasaco_path path;
    fasaco_pose pose;
    if (!fasaco_read_path(payload, size, &path, error))
        return false;
    print_header(&path.header);
    fasaco_path again = path;
    printf(", \"xy\": [");
    while (fasaco_path_next(&path, &pose))
        printf(path.next > 1 ? ", [%.17g, %.17g]" : "[%.17g, %.17g]", pose.x, pose.y);
    printf("], \"yaw\": [");
    while (fasaco_path_next(&again, &pose))
        printf(again.next > 1 ? ", %.17g" : "%.17g", pose.yaw);
    putchar(']');
    return true;
}

/* One list for each member, as the index of the vectors has them. */
static bool show_transforms(const uint8_t *payload, size_t size, fasaco_error *error)
{
    static const char *const MEMBERS[] = {"frames", "children", "stamps_ns", "poses"};
    fasaco_transforms message;
    if (!fasaco_read_transforms(payload, size, &message, error))
        return false;
    for (int member = 0; member < 4; member++) {
        fasaco_transforms all = message;
        fasaco_transform one;
        printf("%s\"%s\": [", member ? ", " : "", MEMBERS[member]);
        while (fasaco_transforms_next(&all, &one)) {
            fputs(all.next > 1 ? ", " : "", stdout);
            if (member == 0)
                print_text(one.header.frame.text, one.header.frame.size);
            else if (member == 1)
                print_text(one.child.text, one.child.size);
            else if (member == 2)
                printf("%" PRId64, stamp_ns(&one.header));
            else
                printf("[%.17g, %.17g, %.17g]", one.pose.x, one.pose.y, one.pose.yaw);
        }
        putchar(']');
    }
    return true;
}

static const struct {
    const char *type;
    bool (*show)(const uint8_t *payload, size_t size, fasaco_error *error);
} TYPES[] = {
    {"geometry_msgs/msg/PoseStamped", show_pose_stamped},
    {"geometry_msgs/msg/PoseWithCovarianceStamped", show_pose_with_covariance},
    {"nav_msgs/msg/Odometry", show_odometry},
    {"geometry_msgs/msg/Twist", show_twist},
    {"geometry_msgs/msg/TwistStamped", show_twist_stamped},
    {"sensor_msgs/msg/BatteryState", show_battery},
    {"sensor_msgs/msg/LaserScan", show_scan},
    {"nav_msgs/msg/OccupancyGrid", show_grid},
    {"map_msgs/msg/OccupancyGridUpdate", show_grid_update},
    {"nav_msgs/msg/Path", show_path},
    {"fasaco_msgs/msg/PheromoneGrid", show_pheromone_grid},
    {"tf2_msgs/msg/TFMessage", show_transforms},
};

static void show(const char *type, const uint8_t *payload, size_t size)
{
    if (strcmp(type, "json") == 0) {
        (void)fwrite(payload, 1, size, stdout);
        putchar('\n');
        return;
    }
    fasaco_error error = {"message type must be one of the contract's, got another"};
    bool read = false;
    putchar('{');
    for (size_t i = 0; i < sizeof TYPES / sizeof *TYPES; i++)
        if (strcmp(type, TYPES[i].type) == 0)
            read = TYPES[i].show(payload, size, &error);
    if (!read)
        print_string("error", error.text, strlen(error.text));
    puts("}");
}

static int print_messages(void)
{
    char type[NAME_BYTES + 1];
    size_t size;
    while (scanf("%128s %zu", type, &size) == 2) {
        if (size > MAX_PAYLOAD || getchar() != '\n') {
            fputs("a message must begin with a line of its type and its size\n", stderr);
            return 2;
        }
        /* Its very size, so that a checker of memory sees each byte read beyond it. */
        uint8_t *payload = malloc(size ? size : 1);
        if (!payload || fread(payload, 1, size, stdin) != size) {
            free(payload);
            fputs("the input ended within a message\n", stderr);
            return 2;
        }
        show(type, payload, size);
        free(payload);
        (void)fflush(stdout);
    }
    return 0;
}

static int write_pose(char *const words[4])
{
    uint8_t payload[FASACO_POSE_STAMPED_BYTES];
    fasaco_error error;
    fasaco_pose pose = {strtod(words[1], NULL), strtod(words[2], NULL), strtod(words[3], NULL)};
    size_t size = fasaco_write_pose_stamped(payload, words[0], (int32_t)time(NULL), 0, pose,
                                            &error);
    if (size == 0) {
        fprintf(stderr, "%s\n", error.text);
        return 1;
    }
    return fwrite(payload, 1, size, stdout) == size ? 0 : 2;
}

int main(int count, char **words)
{
    if (count == 1)
        return print_messages();
    if (count == 6 && strcmp(words[1], "pose") == 0)
        return write_pose(words + 2);
    fputs("usage: fasaco_json [pose FRAME X Y YAW]\n", stderr);
    return 2;
}
