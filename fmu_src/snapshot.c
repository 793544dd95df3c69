/* An instance as bytes: a header, then plain numbers. */

#include <string.h>

#include "gyro_math.h"
#include "plant.h"

static const uint64_t MAGIC = 0x3154415453595247u; /* "GRYSTAT1" read as little-endian bytes; another byte order reads another number */
static const uint64_t VERSION = 3;

typedef struct {
    uint64_t magic;
    uint64_t version;
    uint64_t model;    /* hash of gyro_token */
    uint64_t length;   /* of everything, bytes */
    uint64_t checksum; /* of what follows the header */
} snapshot_header;

/* FNV-1a, 64 bit. */
static uint64_t hash_of(const void *bytes, size_t size)
{
    const unsigned char *byte = bytes;
    uint64_t value = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) {
        value = (value ^ byte[i]) * 0x100000001b3u;
    }
    return value;
}

size_t gyro_save_size(const gyro_instance *g)
{
    gyro_part parts[GYRO_N_PARTS];
    size_t size = sizeof(snapshot_header);
    gyro_list_parts((gyro_instance *)g, parts);
    for (int i = 0; i < GYRO_N_PARTS; i++) {
        size += parts[i].size;
    }
    return size;
}

void gyro_save(const gyro_instance *g, unsigned char *bytes)
{
    gyro_part parts[GYRO_N_PARTS];
    const size_t size = gyro_save_size(g);
    size_t at = sizeof(snapshot_header);
    gyro_list_parts((gyro_instance *)g, parts);
    for (int i = 0; i < GYRO_N_PARTS; i++) {
        if (parts[i].size > 0) {
            memcpy(bytes + at, parts[i].data, parts[i].size);
            at += parts[i].size;
        }
    }
    const snapshot_header header = {MAGIC, VERSION, hash_of(gyro_token, strlen(gyro_token)), size,
                                    hash_of(bytes + sizeof header, size - sizeof header)};
    memcpy(bytes, &header, sizeof header);
}

static gyro_status check_snapshot(gyro_instance *g, const unsigned char *bytes, size_t size)
{
    snapshot_header header = {0};
    gyro_status status = GYRO_OK;
    if (size >= sizeof header) {
        memcpy(&header, bytes, sizeof header);
    }
    if (size < sizeof header || header.magic != MAGIC) {
        status = gyro_refuse(g, "state of %zu bytes: not a saved gyroscope; give bytes that this FMU wrote", size);
    } else if (header.version != VERSION || header.model != hash_of(gyro_token, strlen(gyro_token))) {
        status = gyro_refuse(g, "state of another model or version: give bytes that this very FMU wrote");
    } else if (header.length != size || header.checksum != hash_of(bytes + sizeof header, size - sizeof header)) {
        status = gyro_refuse(g, "state of %zu bytes is damaged: length or checksum differ from its header", size);
    }
    return status;
}

/* Reads the parts first .. last from bytes that must be there. */
static void read_parts(gyro_instance *g, const unsigned char *bytes, int first, int last)
{
    gyro_part parts[GYRO_N_PARTS];
    size_t at = 0;
    gyro_list_parts((gyro_instance *)g, parts);
    for (int i = first; i <= last; i++) {
        if (parts[i].size > 0) {
            memcpy(parts[i].data, bytes + at, parts[i].size);
            at += parts[i].size;
        }
    }
}

/* What gyro_set lets pass: no other number is in the values that it can set. */
static gyro_status check_values(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    for (int vr = 0; vr < GYRO_N_VARIABLES && status == GYRO_OK; vr++) {
        const gyro_variable *variable = &gyro_variables[vr];
        const double value = g->value[vr];
        const int settable = variable->kind != GYRO_OUTPUT;
        const int fixed = variable->kind == GYRO_PARAMETER && gyro_started(g);
        const int whole = fabs(value) <= 2147483648.0 && value == gyro_floor(value);
        if ((settable && !gyro_finite(value)) || (variable->type == GYRO_INTEGER && !whole)) {
            status = gyro_refuse(g, "its %s is %g, which can't have been set", variable->name, value);
        } else if (fixed && value != g->memory.clock.held[vr]) {
            status = gyro_refuse(g, "its %s is %g, and was another when it ran", variable->name, value);
        }
    }
    return status;
}

/* Bytes of all parts but the last. */
static size_t fixed_size(gyro_instance *g)
{
    gyro_part parts[GYRO_N_PARTS];
    size_t size = 0;
    gyro_list_parts(g, parts);
    for (int i = 0; i < GYRO_N_PARTS - 1; i++) {
        size += parts[i].size;
    }
    return size;
}

static gyro_status refuse_why(gyro_instance *g, const char *why) { return why != NULL ? gyro_refuse(g, "%s", why) : GYRO_OK; }

/* What a started instance has beyond the parts of fixed size: `size` bytes are there, and nothing is allocated before they must fit. */
static gyro_status read_run(gyro_instance *g, const unsigned char *bytes, size_t size)
{
    gyro_status status = gyro_finite(g->memory.clock.start_time) ? GYRO_OK : refuse_why(g, "its start time is not finite");
    if (status == GYRO_OK) {
        status = refuse_why(g, gyro_impossible_memory(g));
    }
    if (status == GYRO_OK && size != gyro_room(g)) {
        status = gyro_refuse(g, "%zu bytes are left for what is beside the memory, %zu are due", size, gyro_room(g));
    }
    if (status == GYRO_OK) {
        status = gyro_prepare(g);
    }
    if (status == GYRO_OK) {
        status = gyro_make_room(g);
    }
    if (status == GYRO_OK) {
        read_parts(g, bytes, GYRO_N_PARTS - 1, GYRO_N_PARTS - 1);
        status = refuse_why(g, gyro_impossible_room(g));
    }
    return status;
}

/* Fills a new instance from the body of a snapshot, of which nothing is taken for granted but that `size` bytes are there. */
static gyro_status read_body(gyro_instance *g, const unsigned char *body, size_t size)
{
    const size_t fixed = fixed_size(g);
    gyro_status status = GYRO_OK;
    if (size < fixed) {
        status = gyro_refuse(g, "it ends after %zu of the %zu bytes that every state has", size, fixed);
    } else {
        read_parts(g, body, 0, GYRO_N_PARTS - 2);
        status = check_values(g);
    }
    if (status == GYRO_OK && gyro_started(g)) {
        status = read_run(g, body + fixed, size - fixed);
    } else if (status == GYRO_OK && size != fixed) {
        status = gyro_refuse(g, "it has %zu bytes too many", size - fixed);
    }
    return status;
}

gyro_status gyro_load(gyro_instance *g, const unsigned char *bytes, size_t size, int started)
{
    gyro_instance *loaded = NULL;
    gyro_status status = check_snapshot(g, bytes, size);
    if (status == GYRO_OK) {
        loaded = gyro_new();
        status = loaded != NULL ? read_body(loaded, bytes + sizeof(snapshot_header), size - sizeof(snapshot_header)) : GYRO_ERROR;
        if (status == GYRO_OK && started && !gyro_started(loaded)) {
            status = gyro_refuse(loaded, "it has not started, though its life has gone beyond that");
        }
        if (status != GYRO_OK) {
            gyro_refuse(g, "state not restored: %s", loaded != NULL ? gyro_message(loaded) : "no memory");
        } else {
            /* The two change places, so that what the old one holds goes with the old numbers. */
            const gyro_instance old = *g;
            *g = *loaded;
            *loaded = old;
        }
    }
    gyro_free(loaded);
    return status;
}
