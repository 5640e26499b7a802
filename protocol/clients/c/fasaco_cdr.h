/* Reads the messages of the contract (../../README.md) in plain C11.
 *
 * Nothing is allocated and nothing is kept: strings and cells point into the payload,
 * which has to outlive them. What cannot be read is refused with a text that names the
 * field, what was expected and what came; the payload's size bounds all work.
 *
 * Build: cc -std=c11 -c fasaco_cdr.c; link with -lm. Doubles have to be IEEE 754.
 */
#ifndef FASACO_CDR_H
#define FASACO_CDR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* limits.yaml */
#define FASACO_MAX_STRING_BYTES 256u
#define FASACO_MAX_COORDINATE_M 20000000.0
#define FASACO_MIN_RESOLUTION_M 0.0001
#define FASACO_MAX_RESOLUTION_M 100.0
#define FASACO_QUATERNION_TOLERANCE 0.01
#define FASACO_MAX_GRID_TILT 0.01
#define FASACO_MAX_TRANSFORM_TILT 0.2
#define FASACO_MAX_TRANSFORMS 4096u
#define FASACO_MAX_GRID_CELLS 64000000u
#define FASACO_MAX_PATH_POSES 1000000u
#define FASACO_MAX_SCAN_BEAMS 32768u
#define FASACO_MAX_SCAN_SPAN_RAD 6.5

/* Why a payload was refused. */
typedef struct {
    char text[256];
} fasaco_error;

/* UTF-8 with a NUL at its end, which size does not count. */
typedef struct {
    const char *text;
    uint32_t size;
} fasaco_string;

typedef struct {
    fasaco_string frame;
    int32_t sec;
    uint32_t nanosec;
} fasaco_header;

/* Place [m] and heading [rad], counter-clockwise from the x axis. */
typedef struct {
    double x, y, yaw;
} fasaco_pose;

typedef struct {
    fasaco_header header;
    fasaco_pose pose;
} fasaco_pose_stamped;

/* geometry_msgs/Twist and TwistStamped; the header of the former is empty. */
typedef struct {
    fasaco_header header;
    double speed;     /* linear x [m/s] */
    double turn_rate; /* angular z [rad/s], counter-clockwise */
} fasaco_twist;

/* sensor_msgs/BatteryState; level is NaN where it is not known. */
typedef struct {
    fasaco_header header;
    float level;   /* charge, from 0 to 1 */
    uint8_t power; /* power_supply_status */
} fasaco_battery;

/* sensor_msgs/LaserScan: angles in the sensor's frame [rad], ranges [m]. */
typedef struct {
    fasaco_header header;
    float first, step; /* angles */
    float least, most; /* what the sensor measures; other ranges are none */
    uint32_t count;
    const uint8_t *ranges; /* for fasaco_range alone */
} fasaco_scan;

/* Placement of a grid: origin is the outer corner of cell (0, 0), resolution [m]. */
typedef struct {
    uint32_t rows, cols;
    double resolution;
    fasaco_pose origin;
} fasaco_geometry;

/* nav_msgs/OccupancyGrid: cells row by row, -1 unknown, 0..100. */
typedef struct {
    fasaco_header header;
    fasaco_geometry geometry;
    const int8_t *cells;
} fasaco_grid;

/* map_msgs/OccupancyGridUpdate: a window of the last grid, its corner at (row, col). */
typedef struct {
    fasaco_header header;
    int32_t row, col;
    uint32_t rows, cols;
    const int8_t *cells;
} fasaco_grid_update;

/* fasaco_msgs/PheromoneGrid; see msg/PheromoneGrid.msg. */
typedef struct {
    fasaco_header header;
    fasaco_geometry geometry;
    float trail_min, trail_max;
    uint32_t cohort, velocity, ants, best_steps;
    const uint8_t *levels;
} fasaco_pheromone_grid;

/* nav_msgs/Path: read and checked as a whole, its poses one after the other. */
typedef struct {
    fasaco_header header;
    uint32_t count;
    uint32_t next;         /* the pose fasaco_path_next gives next */
    const uint8_t *body;   /* all below is for fasaco_path_next alone */
    size_t size, position;
} fasaco_path;

/* tf2_msgs/TFMessage: read and checked as a whole, its transforms one after the other. */
typedef struct {
    uint32_t count;
    uint32_t next;         /* the transform fasaco_transforms_next gives next */
    const uint8_t *body;   /* all below is for fasaco_transforms_next alone */
    size_t size, position;
} fasaco_transforms;

/* Where frame child lies in the plane of header.frame. */
typedef struct {
    fasaco_header header;
    fasaco_string child;
    fasaco_pose pose;
} fasaco_transform;

/* Each reads one payload; false, and a text in *error, if it is refused. */
bool fasaco_read_pose_stamped(const uint8_t *payload, size_t size, fasaco_pose_stamped *pose,
                              fasaco_error *error);
bool fasaco_read_pose_with_covariance_stamped(const uint8_t *payload, size_t size,
                                              fasaco_pose_stamped *pose, fasaco_error *error);
bool fasaco_read_odometry(const uint8_t *payload, size_t size, fasaco_pose_stamped *pose,
                          fasaco_error *error);
bool fasaco_read_twist(const uint8_t *payload, size_t size, fasaco_twist *twist,
                       fasaco_error *error);
bool fasaco_read_twist_stamped(const uint8_t *payload, size_t size, fasaco_twist *twist,
                               fasaco_error *error);
bool fasaco_read_battery(const uint8_t *payload, size_t size, fasaco_battery *battery,
                         fasaco_error *error);
bool fasaco_read_scan(const uint8_t *payload, size_t size, fasaco_scan *scan,
                      fasaco_error *error);
/* The range of beam i, below count; it may be infinite or NaN. */
float fasaco_range(const fasaco_scan *scan, uint32_t i);
bool fasaco_read_grid(const uint8_t *payload, size_t size, fasaco_grid *grid,
                      fasaco_error *error);
bool fasaco_read_grid_update(const uint8_t *payload, size_t size, fasaco_grid_update *update,
                             fasaco_error *error);
bool fasaco_read_pheromone_grid(const uint8_t *payload, size_t size, fasaco_pheromone_grid *grid,
                                fasaco_error *error);
bool fasaco_read_path(const uint8_t *payload, size_t size, fasaco_path *path,
                      fasaco_error *error);

bool fasaco_read_transforms(const uint8_t *payload, size_t size, fasaco_transforms *transforms,
                            fasaco_error *error);

/* Gives the next transform of a message that was read; false behind the last. */
bool fasaco_transforms_next(fasaco_transforms *transforms, fasaco_transform *transform);

/* Gives the next pose of a path that was read; false behind the last. */
bool fasaco_path_next(fasaco_path *path, fasaco_pose *pose);

/* A geometry_msgs/PoseStamped has at most so many bytes. */
#define FASACO_POSE_STAMPED_BYTES (4u + 12u + FASACO_MAX_STRING_BYTES + 1u + 7u + 56u)

/* Writes a geometry_msgs/PoseStamped, what a robot has to send; returns its size, or 0 and a
 * text in *error where a reader would refuse it. */
size_t fasaco_write_pose_stamped(uint8_t payload[FASACO_POSE_STAMPED_BYTES], const char *frame,
                                 int32_t sec, uint32_t nanosec, fasaco_pose pose,
                                 fasaco_error *error);

#endif
