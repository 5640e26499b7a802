#include "fasaco_cdr.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { HEADER_BYTES = 4, MAX_PADDING = 3, LEAST_POSE_BYTES = 72, LEAST_TRANSFORM_BYTES = 80,
       NAME_BYTES = 64 };

static const uint32_t SECOND_NS = 1000000000u;

/* Reads fields in order. The first that is refused leaves its reason in *error; from then on
 * all fields are 0 and nothing is read. */
typedef struct {
    const uint8_t *body; /* behind the encapsulation header: alignment counts from here */
    size_t size, position;
    uint8_t counted; /* padding the header speaks of */
    bool ok;
    fasaco_error *error;
} reader;

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void refuse(reader *r, const char *format, ...)
{
    if (!r->ok)
        return;
    r->ok = false;
    va_list words;
    va_start(words, format);
    (void)vsnprintf(r->error->text, sizeof r->error->text, format, words);
    va_end(words);
}

static reader begin(const uint8_t *payload, size_t size, fasaco_error *error)
{
    reader r = {.ok = true, .error = error};
    error->text[0] = '\0';
    if (size < HEADER_BYTES) {
        refuse(&r, "encapsulation header must be 00 01 00 00, got %zu bytes", size);
        return r;
    }
    if (payload[0] != 0 || payload[1] != 1 || payload[2] != 0 || payload[3] > MAX_PADDING)
        refuse(&r, "encapsulation header must be 00 01 00 00, got %02x %02x %02x %02x",
               payload[0], payload[1], payload[2], payload[3]);
    r.body = payload + HEADER_BYTES;
    r.size = size - HEADER_BYTES;
    r.counted = payload[3];
    return r;
}

/* Returns where a field of so many bytes begins, NULL where it is not there as a whole. */
static const uint8_t *take(reader *r, size_t alignment, size_t size, const char *field)
{
    if (!r->ok)
        return NULL;
    size_t padding = (alignment - r->position % alignment) % alignment;
    size_t left = r->size - r->position;
    if (left < padding || left - padding < size) {
        refuse(r, "%s must be %zu bytes, got the end of the payload", field, size);
        return NULL;
    }
    const uint8_t *start = r->body + r->position + padding;
    r->position += padding + size;
    return start;
}

static uint32_t word(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static double number(const uint8_t *at)
{
    uint64_t bits = (uint64_t)word(at) | (uint64_t)word(at + 4) << 32;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t read_uint32(reader *r, const char *field)
{
    const uint8_t *at = take(r, 4, 4, field);
    return at ? word(at) : 0;
}

static int32_t read_int32(reader *r, const char *field)
{
    uint32_t bits = read_uint32(r, field);
    int32_t value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static float read_float32(reader *r, const char *field)
{
    uint32_t bits = read_uint32(r, field);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* RFC 3629: the shortest form, no surrogates, nothing beyond U+10FFFF. */
static bool is_utf8(const uint8_t *text, size_t size)
{
    static const uint32_t LEAST[] = {0, 0x80, 0x800, 0x10000};
    for (size_t at = 0; at < size;) {
        uint8_t lead = text[at++];
        size_t more = lead < 0x80 ? 0 : lead >> 5 == 6 ? 1 : lead >> 4 == 14 ? 2 : 3;
        if (more == 0)
            continue;
        if ((more == 3 && lead >> 3 != 30) || size - at < more)
            return false;
        uint32_t point = lead & (0x3fu >> more);
        for (size_t end = at + more; at < end; at++) {
            if (text[at] >> 6 != 2)
                return false;
            point = point << 6 | (text[at] & 0x3fu);
        }
        if (point < LEAST[more] || point > 0x10ffff || (point >= 0xd800 && point < 0xe000))
            return false;
    }
    return true;
}

static fasaco_string read_string(reader *r, const char *field)
{
    char name[NAME_BYTES + 16];
    (void)snprintf(name, sizeof name, "length of %s", field);
    uint32_t length = read_uint32(r, name);
    if (r->ok && (length < 1 || length > FASACO_MAX_STRING_BYTES + 1))
        refuse(r, "%s must be 1..%u, got %u", name, FASACO_MAX_STRING_BYTES + 1, length);
    const uint8_t *text = take(r, 1, length, field);
    if (!text)
        return (fasaco_string){"", 0};
    if (memchr(text, 0, length) != text + length - 1)
        refuse(r, "%s must be a string with one NUL, at its end, got another", field);
    else if (!is_utf8(text, length - 1))
        refuse(r, "%s must be UTF-8, got other bytes", field);
    return (fasaco_string){(const char *)text, length - 1};
}

static void read_stamp(reader *r, const char *field, int32_t *sec, uint32_t *nanosec)
{
    char name[NAME_BYTES + 16];
    (void)snprintf(name, sizeof name, "%s.sec", field);
    *sec = read_int32(r, name);
    (void)snprintf(name, sizeof name, "%s.nanosec", field);
    *nanosec = read_uint32(r, name);
    if (r->ok && *nanosec >= SECOND_NS)
        refuse(r, "%s must be less than %u, got %u", name, SECOND_NS, *nanosec);
}

static fasaco_header read_header(reader *r, const char *field)
{
    fasaco_header header = {0};
    char name[NAME_BYTES];
    (void)snprintf(name, sizeof name, "%s.stamp", field);
    read_stamp(r, name, &header.sec, &header.nanosec);
    (void)snprintf(name, sizeof name, "%s.frame_id", field);
    header.frame = read_string(r, name);
    return header;
}

static void check_place(reader *r, const double place[3], const char *name)
{
    for (int axis = 0; axis < 3; axis++)
        /* Negated, so that NaN is caught too. */
        if (!(fabs(place[axis]) <= FASACO_MAX_COORDINATE_M))
            refuse(r, "%s.%c must be within %g m of 0, got %g", name, "xyz"[axis],
                   FASACO_MAX_COORDINATE_M, place[axis]);
}

/* Reads a place and a quaternion, called so; *tilt is the larger magnitude of the latter's x
 * and y. */
static fasaco_pose read_placement(reader *r, const char *field, const char *place,
                                  const char *turn, double *tilt)
{
    const uint8_t *at = take(r, 8, 56, field);
    if (!at)
        return (fasaco_pose){0};
    double values[7];
    for (int i = 0; i < 7; i++)
        values[i] = number(at + 8 * i);
    check_place(r, values, place);
    double x = values[3], y = values[4], z = values[5], w = values[6];
    double norm = sqrt(x * x + y * y + z * z + w * w);
    if (!(fabs(norm - 1.0) <= FASACO_QUATERNION_TOLERANCE))
        refuse(r, "norm of %s must be 1 within %g, got %g", turn, FASACO_QUATERNION_TOLERANCE,
               norm);
    if (tilt)
        *tilt = fmax(fabs(x), fabs(y));
    double yaw = atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    return (fasaco_pose){values[0], values[1], yaw};
}

/* Reads a geometry_msgs/Pose; tilt as above. */
static fasaco_pose read_pose(reader *r, const char *field, double *tilt)
{
    char place[NAME_BYTES + 16], turn[NAME_BYTES + 16];
    (void)snprintf(place, sizeof place, "%s.position", field);
    (void)snprintf(turn, sizeof turn, "%s.orientation", field);
    return read_placement(r, field, place, turn, tilt);
}

/* Returns the shortest decimal that is this float32, as a double. */
static double shortest(float value)
{
    char text[32];
    for (int digits = 1; digits < 9; digits++) {
        (void)snprintf(text, sizeof text, "%.*g", digits, (double)value);
        if (strtof(text, NULL) == value)
            return strtod(text, NULL);
    }
    (void)snprintf(text, sizeof text, "%.9g", (double)value);
    return strtod(text, NULL);
}

static fasaco_geometry read_geometry(reader *r)
{
    fasaco_geometry geometry = {0};
    int32_t sec;
    uint32_t nanosec;
    double tilt = 0.0;
    read_stamp(r, "info.map_load_time", &sec, &nanosec);
    geometry.resolution = shortest(read_float32(r, "info.resolution"));
    if (r->ok && !(geometry.resolution >= FASACO_MIN_RESOLUTION_M &&
                   geometry.resolution <= FASACO_MAX_RESOLUTION_M))
        refuse(r, "info.resolution must be %g..%g m, got %g", FASACO_MIN_RESOLUTION_M,
               FASACO_MAX_RESOLUTION_M, geometry.resolution);
    geometry.cols = read_uint32(r, "info.width");
    geometry.rows = read_uint32(r, "info.height");
    geometry.origin = read_pose(r, "info.origin", &tilt);
    if (tilt > FASACO_MAX_GRID_TILT)
        refuse(r, "info.origin.orientation must be a turn about z (x and y within %g), got %g",
               FASACO_MAX_GRID_TILT, tilt);
    return geometry;
}

/* Nothing may follow the last field but zeros up to a multiple of four. */
static bool end(reader *r)
{
    if (!r->ok)
        return false;
    size_t left = r->size - r->position;
    /* The header is four bytes: a multiple of four of the body is one of the payload. */
    bool rounded = left == 0 || (left <= MAX_PADDING && r->size % 4 == 0);
    for (size_t i = 0; rounded && i < left; i++)
        rounded = r->body[r->position + i] == 0;
    if (!rounded || (r->counted != 0 && r->counted != left))
        refuse(r, "payload must be at its end after %zu bytes, or %u counted ones of padding, "
               "got %zu bytes more", HEADER_BYTES + r->position, r->counted, left);
    return r->ok;
}

/* Reads the last field, a byte for each of rows x cols cells. */
static const uint8_t *read_cells(reader *r, uint32_t rows, uint32_t cols, const char *field)
{
    char name[NAME_BYTES];
    (void)snprintf(name, sizeof name, "length of %s", field);
    uint32_t count = read_uint32(r, name);
    if (!r->ok)
        return NULL;
    if (count > r->size - r->position)
        refuse(r, "%s must be at most %zu, got %u", name, r->size - r->position, count);
    if (count < 1 || count > FASACO_MAX_GRID_CELLS)
        refuse(r, "%s must be 1..%u, got %u", name, FASACO_MAX_GRID_CELLS, count);
    if (count != (uint64_t)rows * cols)
        refuse(r, "%s must be width x height = %u x %u, got %u", name, cols, rows, count);
    const uint8_t *cells = take(r, 1, count, field);
    (void)end(r);
    return cells;
}

static const int8_t *read_occupancy(reader *r, uint32_t rows, uint32_t cols)
{
    const int8_t *cells = (const int8_t *)read_cells(r, rows, cols, "data");
    for (size_t i = 0; r->ok && i < (size_t)rows * cols; i++)
        if (cells[i] < -1 || cells[i] > 100)
            refuse(r, "data at row %zu, column %zu must be -1..100, got %d", i / cols, i % cols,
                   cells[i]);
    return cells;
}

/* Reads the six numbers of a twist, the last fields; names begin with ``before``. */
static bool read_twist(reader *r, const char *before, fasaco_twist *twist)
{
    static const char *const NAMES[] = {"linear.x",  "linear.y",  "linear.z",
                                        "angular.x", "angular.y", "angular.z"};
    const uint8_t *at = take(r, 8, 48, "twist");
    if (!end(r))
        return false;
    for (int i = 0; i < 6; i++)
        if (!isfinite(number(at + 8 * i)))
            refuse(r, "%s%s must be a finite number, got %g", before, NAMES[i],
                   number(at + 8 * i));
    twist->speed = number(at);
    twist->turn_rate = number(at + 40);
    return r->ok;
}

bool fasaco_read_twist(const uint8_t *payload, size_t size, fasaco_twist *twist,
                       fasaco_error *error)
{
    reader r = begin(payload, size, error);
    twist->header = (fasaco_header){0};
    return read_twist(&r, "", twist);
}

bool fasaco_read_twist_stamped(const uint8_t *payload, size_t size, fasaco_twist *twist,
                               fasaco_error *error)
{
    reader r = begin(payload, size, error);
    twist->header = read_header(&r, "header");
    return read_twist(&r, "twist.", twist);
}

bool fasaco_read_scan(const uint8_t *payload, size_t size, fasaco_scan *scan,
                      fasaco_error *error)
{
    static const char *const NAMES[] = {"angle_min", "angle_max", "angle_increment",
                                        "time_increment", "scan_time", "range_min", "range_max"};
    float floats[7];
    reader r = begin(payload, size, error);
    scan->header = read_header(&r, "header");
    for (int i = 0; i < 7; i++)
        floats[i] = read_float32(&r, NAMES[i]);
    scan->first = floats[0], scan->step = floats[2];
    scan->least = floats[5], scan->most = floats[6];
    scan->count = read_uint32(&r, "length of ranges");
    for (int i = 0; i < 7; i++)
        if (r.ok && (i == 0 || i == 2 || i > 4) && !isfinite(floats[i]))
            refuse(&r, "%s must be a finite number, got %g", NAMES[i], (double)floats[i]);
    if (r.ok && (scan->count < 1 || scan->count > FASACO_MAX_SCAN_BEAMS))
        refuse(&r, "length of ranges must be 1..%u, got %u", FASACO_MAX_SCAN_BEAMS, scan->count);
    if (r.ok && fabs((double)scan->first) > FASACO_MAX_SCAN_SPAN_RAD)
        refuse(&r, "angle_min must be within %g of 0, got %g", FASACO_MAX_SCAN_SPAN_RAD,
               (double)scan->first);
    double span = r.ok ? fabs((double)scan->step) * (scan->count - 1) : 0;
    if (r.ok && (span > FASACO_MAX_SCAN_SPAN_RAD || (scan->count > 1 && scan->step == 0)))
        refuse(&r, "angle_increment must be not 0, and at most %g over all beams, got %g",
               FASACO_MAX_SCAN_SPAN_RAD, (double)scan->step);
    if (r.ok && !(scan->least >= 0 && scan->least < scan->most))
        refuse(&r, "range_min must be at least 0 and below range_max, %g, got %g",
               (double)scan->most, (double)scan->least);
    scan->ranges = take(&r, 4, 4 * (size_t)scan->count, "ranges");
    uint32_t others = read_uint32(&r, "length of intensities");
    (void)take(&r, 4, 4 * (size_t)others, "intensities");
    return end(&r);
}

float fasaco_range(const fasaco_scan *scan, uint32_t i)
{
    uint32_t bits = word(scan->ranges + 4 * (size_t)i);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

bool fasaco_read_battery(const uint8_t *payload, size_t size, fasaco_battery *battery,
                         fasaco_error *error)
{
    static const char *const CELLS[] = {"cell_voltage", "cell_temperature"};
    static const char *const NAMES[] = {"location", "serial_number"};
    reader r = begin(payload, size, error);
    battery->header = read_header(&r, "header");
    (void)take(&r, 4, 24, "voltage");
    battery->level = read_float32(&r, "percentage");
    if (r.ok && !isnan(battery->level) && !(battery->level >= 0 && battery->level <= 1))
        refuse(&r, "percentage must be in 0..1, or NaN where it is not known, got %g",
               (double)battery->level);
    const uint8_t *status = take(&r, 1, 4, "power_supply_status");
    battery->power = status ? *status : 0;
    if (battery->power > 4)
        refuse(&r, "power_supply_status must be below 5, got %u", battery->power);
    for (int i = 0; i < 2; i++) {
        uint32_t count = read_uint32(&r, CELLS[i]);
        (void)take(&r, 4, 4 * (size_t)count, CELLS[i]);
    }
    for (int i = 0; i < 2; i++)
        (void)read_string(&r, NAMES[i]);
    return end(&r);
}

bool fasaco_read_pose_stamped(const uint8_t *payload, size_t size, fasaco_pose_stamped *pose,
                              fasaco_error *error)
{
    reader r = begin(payload, size, error);
    pose->header = read_header(&r, "header");
    pose->pose = read_pose(&r, "pose", NULL);
    return end(&r);
}

bool fasaco_read_pose_with_covariance_stamped(const uint8_t *payload, size_t size,
                                              fasaco_pose_stamped *pose, fasaco_error *error)
{
    reader r = begin(payload, size, error);
    pose->header = read_header(&r, "header");
    pose->pose = read_pose(&r, "pose.pose", NULL);
    (void)take(&r, 8, 36 * 8, "pose.covariance");
    return end(&r);
}

bool fasaco_read_odometry(const uint8_t *payload, size_t size, fasaco_pose_stamped *pose,
                          fasaco_error *error)
{
    reader r = begin(payload, size, error);
    pose->header = read_header(&r, "header");
    (void)read_string(&r, "child_frame_id");
    pose->pose = read_pose(&r, "pose.pose", NULL);
    (void)take(&r, 8, 36 * 8, "pose.covariance");
    (void)take(&r, 8, 6 * 8, "twist.twist");
    (void)take(&r, 8, 36 * 8, "twist.covariance");
    return end(&r);
}

bool fasaco_read_grid(const uint8_t *payload, size_t size, fasaco_grid *grid,
                      fasaco_error *error)
{
    reader r = begin(payload, size, error);
    grid->header = read_header(&r, "header");
    grid->geometry = read_geometry(&r);
    grid->cells = read_occupancy(&r, grid->geometry.rows, grid->geometry.cols);
    return r.ok;
}

bool fasaco_read_grid_update(const uint8_t *payload, size_t size, fasaco_grid_update *update,
                             fasaco_error *error)
{
    reader r = begin(payload, size, error);
    update->header = read_header(&r, "header");
    update->col = read_int32(&r, "x");
    update->row = read_int32(&r, "y");
    update->cols = read_uint32(&r, "width");
    update->rows = read_uint32(&r, "height");
    update->cells = read_occupancy(&r, update->rows, update->cols);
    return r.ok;
}

bool fasaco_read_pheromone_grid(const uint8_t *payload, size_t size, fasaco_pheromone_grid *grid,
                                fasaco_error *error)
{
    reader r = begin(payload, size, error);
    grid->header = read_header(&r, "header");
    grid->geometry = read_geometry(&r);
    grid->trail_min = read_float32(&r, "trail_min");
    grid->trail_max = read_float32(&r, "trail_max");
    grid->cohort = read_uint32(&r, "cohort");
    grid->velocity = read_uint32(&r, "velocity");
    grid->ants = read_uint32(&r, "ants");
    grid->best_steps = read_uint32(&r, "best_steps");
    grid->levels = read_cells(&r, grid->geometry.rows, grid->geometry.cols, "levels");
    if (!r.ok)
        return false;
    bool empty = grid->trail_min == 0.0f && grid->trail_max == 0.0f;
    for (size_t i = 0; empty && i < (size_t)grid->geometry.rows * grid->geometry.cols; i++)
        empty = grid->levels[i] == 0;
    if (!empty && !(0.0f < grid->trail_min && grid->trail_min <= grid->trail_max &&
                    isfinite(grid->trail_max)))
        refuse(&r, "trail_min, trail_max must be finite with 0 < trail_min <= trail_max, or 0 "
               "where no level is above 0, got %g, %g", (double)grid->trail_min,
               (double)grid->trail_max);
    return r.ok;
}

/* Reads pose number index of a path, which is in the path's frame or names none. */
static fasaco_pose read_path_pose(reader *r, fasaco_string frame, uint32_t index)
{
    char field[NAME_BYTES];
    (void)snprintf(field, sizeof field, "poses[%u].header", index);
    fasaco_string named = read_header(r, field).frame;
    if (r->ok && named.size != 0 &&
        (named.size != frame.size || memcmp(named.text, frame.text, named.size) != 0))
        refuse(r, "%s.frame_id must be as the path's, or '', got another", field);
    (void)snprintf(field, sizeof field, "poses[%u].pose", index);
    return read_pose(r, field, NULL);
}

bool fasaco_read_path(const uint8_t *payload, size_t size, fasaco_path *path,
                      fasaco_error *error)
{
    reader r = begin(payload, size, error);
    path->header = read_header(&r, "header");
    path->count = read_uint32(&r, "length of poses");
    path->next = 0;
    if (r.ok && (uint64_t)path->count * LEAST_POSE_BYTES > r.size - r.position)
        refuse(&r, "length of poses must be at most %zu in %zu bytes, got %u",
               (r.size - r.position) / LEAST_POSE_BYTES, r.size - r.position, path->count);
    if (r.ok && path->count > FASACO_MAX_PATH_POSES)
        refuse(&r, "length of poses must be at most %u, got %u", FASACO_MAX_PATH_POSES,
               path->count);
    path->body = r.body;
    path->size = r.size;
    path->position = r.position;
    for (uint32_t index = 0; r.ok && index < path->count; index++)
        (void)read_path_pose(&r, path->header.frame, index);
    return end(&r);
}

bool fasaco_path_next(fasaco_path *path, fasaco_pose *pose)
{
    if (path->next >= path->count)
        return false;
    fasaco_error error;
    reader r = {.body = path->body, .size = path->size, .position = path->position,
                .ok = true, .error = &error};
    *pose = read_path_pose(&r, path->header.frame, path->next);
    path->next++;
    path->position = r.position;
    return r.ok;
}

static fasaco_transform read_transform(reader *r, uint32_t index)
{
    fasaco_transform transform;
    char field[NAME_BYTES], place[2 * NAME_BYTES], turn[2 * NAME_BYTES];
    double tilt = 0.0;
    (void)snprintf(field, sizeof field, "transforms[%u].header", index);
    transform.header = read_header(r, field);
    (void)snprintf(field, sizeof field, "transforms[%u].child_frame_id", index);
    transform.child = read_string(r, field);
    (void)snprintf(field, sizeof field, "transforms[%u].transform", index);
    (void)snprintf(place, sizeof place, "%s.translation", field);
    (void)snprintf(turn, sizeof turn, "rotation of %s", field);
    transform.pose = read_placement(r, field, place, turn, &tilt);
    if (tilt > FASACO_MAX_TRANSFORM_TILT)
        refuse(r, "%s must be a turn about z (x and y within %g), got %g", turn,
               FASACO_MAX_TRANSFORM_TILT, tilt);
    return transform;
}

bool fasaco_read_transforms(const uint8_t *payload, size_t size, fasaco_transforms *transforms,
                            fasaco_error *error)
{
    reader r = begin(payload, size, error);
    transforms->count = read_uint32(&r, "length of transforms");
    transforms->next = 0;
    if (r.ok && (uint64_t)transforms->count * LEAST_TRANSFORM_BYTES > r.size - r.position)
        refuse(&r, "length of transforms must be at most %zu in %zu bytes, got %u",
               (r.size - r.position) / LEAST_TRANSFORM_BYTES, r.size - r.position,
               transforms->count);
    if (r.ok && transforms->count > FASACO_MAX_TRANSFORMS)
        refuse(&r, "length of transforms must be at most %u, got %u", FASACO_MAX_TRANSFORMS,
               transforms->count);
    transforms->body = r.body;
    transforms->size = r.size;
    transforms->position = r.position;
    for (uint32_t index = 0; r.ok && index < transforms->count; index++)
        (void)read_transform(&r, index);
    return end(&r);
}

bool fasaco_transforms_next(fasaco_transforms *transforms, fasaco_transform *transform)
{
    if (transforms->next >= transforms->count)
        return false;
    fasaco_error error;
    reader r = {.body = transforms->body, .size = transforms->size,
                .position = transforms->position, .ok = true, .error = &error};
    *transform = read_transform(&r, transforms->next);
    transforms->next++;
    transforms->position = r.position;
    return r.ok;
}

static uint8_t *put_word(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
    return at + 4;
}

static uint8_t *put_number(uint8_t *at, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_word(put_word(at, (uint32_t)bits), (uint32_t)(bits >> 32));
}

size_t fasaco_write_pose_stamped(uint8_t payload[FASACO_POSE_STAMPED_BYTES], const char *frame,
                                 int32_t sec, uint32_t nanosec, fasaco_pose pose,
                                 fasaco_error *error)
{
    static const uint8_t HEADER[HEADER_BYTES] = {0, 1, 0, 0};
    size_t length = strlen(frame) + 1;
    if (length > FASACO_MAX_STRING_BYTES + 1) {
        (void)snprintf(error->text, sizeof error->text,
                       "length of header.frame_id must be 1..%u, got %zu",
                       FASACO_MAX_STRING_BYTES + 1, length);
        return 0;
    }
    memset(payload, 0, FASACO_POSE_STAMPED_BYTES);
    memcpy(payload, HEADER, sizeof HEADER);
    uint8_t *at = put_word(payload + HEADER_BYTES, (uint32_t)sec);
    at = put_word(put_word(at, nanosec), (uint32_t)length);
    memcpy(at, frame, length);
    size_t position = 12 + length;
    at = payload + HEADER_BYTES + (position + 7) / 8 * 8;
    at = put_number(put_number(put_number(at, pose.x), pose.y), 0.0);
    at = put_number(put_number(at, 0.0), 0.0);
    at = put_number(put_number(at, sin(pose.yaw / 2)), cos(pose.yaw / 2));
    size_t size = (size_t)(at - payload);
    fasaco_pose_stamped again;
    return fasaco_read_pose_stamped(payload, size, &again, error) ? size : 0;
}
