/* A saved state: a header and the bytes of the core.

   byte  0  magic, 8 characters, the last one counts the layouts
   byte  8  length of everything, bytes
   byte 16  checksum of all that follows, begun with the model's token: a state of another model does not pass
   byte 24  life-cycle state, then what the instance was made for, then 1 where a sample's event is not over, a byte each
   byte 32  start time, s (the bits of a double)
   byte 40  stop time, s
   byte 48  gyro_save
   Integers of 8 bytes, least significant first. */

#include "continuous.h"
#include "fmi_common.h"

#include <stdlib.h>
#include <string.h>

#include "gyro_math.h"

static const unsigned char magic[8] = {'G', 'Y', 'R', 'O', 'F', 'M', 'U', '2'};

enum { AT_LENGTH = 8, AT_CHECKSUM = 16, AT_STATE = 24, AT_START = 32, AT_STOP = 40, AT_CORE = 48 };

typedef struct {
    size_t size;           /* of bytes */
    unsigned char bytes[]; /* as above */
} saved_block;

static void put_u64(unsigned char *at, uint64_t value)
{
    for (unsigned i = 0; i < 8; i++) {
        at[i] = (unsigned char)(value >> (8 * i));
    }
}

static uint64_t get_u64(const unsigned char *at)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < 8; i++) {
        value |= (uint64_t)at[i] << (8 * i);
    }
    return value;
}

static void put_f64(unsigned char *at, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_u64(at, bits);
}

static double get_f64(const unsigned char *at)
{
    uint64_t bits = get_u64(at);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* FNV-1a, 64 bits: every step is one-to-one in the hash, so any single changed byte changes the result. */
static uint64_t hash(uint64_t h, const unsigned char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        h = (h ^ bytes[i]) * UINT64_C(1099511628211);
    }
    return h;
}

static uint64_t checksum(const unsigned char *bytes, size_t size)
{
    uint64_t h = hash(UINT64_C(14695981039346656037), (const unsigned char *)gyro_token, strlen(gyro_token));
    return hash(h, bytes + AT_STATE, size - AT_STATE);
}

static fmi_status fail_null(const fmi_instance *f, const char *call, const char *argument)
{
    return fmi_fail(f, call, "%s is NULL", argument);
}

/* A header that fmi_save can have written: a checksum can be made to fit anything. */
static fmi_status check_header(const fmi_instance *f, const char *call, const unsigned char bytes[])
{
    const uint64_t state = bytes[AT_STATE], purpose = get_u64(bytes + AT_STATE) / 256 % 256, ticking = get_u64(bytes + AT_STATE) / 65536;
    const unsigned modes = purpose == CO_SIMULATION ? STEPPING : purpose == MODEL_EXCHANGE ? EVENT | CONTINUOUS : STEPPING | EVENT;
    const double start = get_f64(bytes + AT_START), stop = get_f64(bytes + AT_STOP);
    fmi_status status = FMI_OK;
    const unsigned possible = INSTANTIATED | INITIALIZATION | TERMINATED | modes;
    if (purpose > CO_SIMULATION_WITH_EVENTS || ticking > 1 || (state & possible) == 0 || (state & (state - 1)) != 0) {
        status = fmi_fail(f, call, "the saved state has the life-cycle state %llu, which is none; pass bytes that this FMU wrote",
                          (unsigned long long)state);
    } else if (!gyro_finite(start) || !(stop >= start)) {
        status = fmi_fail(f, call, "the saved state goes from %g s to %g s; pass bytes that this FMU wrote", start, stop);
    }
    return status;
}

/* *saved with room for `size` bytes; unchanged when memory is short. */
static fmi_status make_room(const fmi_instance *f, const char *call, void **saved, size_t size)
{
    fmi_status status = FMI_OK;
    saved_block *block = realloc(*saved, sizeof *block + size);
    if (block == NULL) {
        status = fmi_fail(f, call, "out of memory: a state takes %lu bytes", (unsigned long)size);
    } else {
        block->size = size;
        *saved = block;
    }
    return status;
}

fmi_status fmi_save(fmi_instance *f, const char *call, void **saved)
{
    fmi_status status = fmi_allow(f, call, CAN_SAVE);
    if (status == FMI_OK && saved == NULL) {
        status = fail_null(f, call, "the address for the state");
    }
    if (status == FMI_OK) {
        status = make_room(f, call, saved, AT_CORE + gyro_save_size(f->core));
    }
    if (status == FMI_OK) {
        saved_block *block = *saved;
        unsigned char *bytes = block->bytes;
        memcpy(bytes, magic, sizeof magic);
        put_u64(bytes + AT_LENGTH, block->size);
        put_u64(bytes + AT_STATE, f->state + 256u * (uint64_t)f->purpose + 65536u * (uint64_t)(f->ticking != 0));
        put_f64(bytes + AT_START, f->start_time);
        put_f64(bytes + AT_STOP, f->stop_time);
        gyro_save(f->core, bytes + AT_CORE);
        put_u64(bytes + AT_CHECKSUM, checksum(bytes, block->size));
    }
    return status;
}

fmi_status fmi_restore(fmi_instance *f, const char *call, const void *saved)
{
    const saved_block *block = saved;
    fmi_status status = fmi_allow(f, call, CAN_RESTORE);
    if (status == FMI_OK && block == NULL) {
        status = fail_null(f, call, "the state");
    }
    if (status == FMI_OK && block->bytes[AT_STATE + 1] != f->purpose) {
        status = fmi_fail(f, call, "the state is of an instance made for another purpose (model exchange, co-simulation, or that with events)");
    }
    if (status == FMI_OK) {
        const int started = (block->bytes[AT_STATE] & (RUNNING | TERMINATED)) != 0;
        if (gyro_load(f->core, block->bytes + AT_CORE, block->size - AT_CORE, started) != GYRO_OK) {
            status = fmi_fail(f, call, "%s", gyro_message(f->core));
        }
    }
    if (status == FMI_OK) {
        f->state = block->bytes[AT_STATE];
        f->ticking = block->bytes[AT_STATE + 2];
        f->last_step = FMI_OK;
        f->start_time = get_f64(block->bytes + AT_START);
        f->stop_time = get_f64(block->bytes + AT_STOP);
        fmi_find_latest_time(f);
        if (f->purpose == MODEL_EXCHANGE && (f->state & (EVENT | CONTINUOUS)) != 0) {
            gyro_resume_time(f->core);
        }
    }
    return status;
}

fmi_status fmi_free_saved(const fmi_instance *f, const char *call, void **saved)
{
    fmi_status status = fmi_allow(f, call, ANY_STATE);
    if (status == FMI_OK && saved != NULL) {
        free(*saved);
        *saved = NULL;
    }
    return status;
}

fmi_status fmi_saved_size(const fmi_instance *f, const char *call, const void *saved, size_t *size)
{
    fmi_status status = fmi_allow(f, call, CAN_SAVE);
    if (status == FMI_OK && (saved == NULL || size == NULL)) {
        status = fail_null(f, call, saved == NULL ? "the state" : "the address for the size");
    }
    if (status == FMI_OK) {
        *size = ((const saved_block *)saved)->size;
    }
    return status;
}

fmi_status fmi_serialize(const fmi_instance *f, const char *call, const void *saved, unsigned char bytes[], size_t size)
{
    const saved_block *block = saved;
    fmi_status status = fmi_allow(f, call, CAN_SAVE);
    if (status == FMI_OK && (block == NULL || bytes == NULL)) {
        status = fail_null(f, call, block == NULL ? "the state" : "the array of bytes");
    } else if (status == FMI_OK && size != block->size) {
        status = fmi_fail(f, call, "the array holds %lu bytes, the state has %lu; ask for its size first", (unsigned long)size,
                          (unsigned long)block->size);
    }
    if (status == FMI_OK) {
        memcpy(bytes, block->bytes, size);
    }
    return status;
}

fmi_status fmi_deserialize(const fmi_instance *f, const char *call, const unsigned char bytes[], size_t size, void **saved)
{
    fmi_status status = fmi_allow(f, call, CAN_RESTORE);
    if (status == FMI_OK && (bytes == NULL || saved == NULL)) {
        status = fail_null(f, call, bytes == NULL ? "the array of bytes" : "the address for the state");
    } else if (status == FMI_OK && (size < AT_CORE || memcmp(bytes, magic, sizeof magic) != 0)) {
        status = fmi_fail(f, call, "these %lu bytes are not a saved state of this FMU", (unsigned long)size);
    } else if (status == FMI_OK && get_u64(bytes + AT_LENGTH) != size) {
        status = fmi_fail(f, call, "the saved state has %lu bytes, %lu were passed; pass all of it",
                          (unsigned long)get_u64(bytes + AT_LENGTH), (unsigned long)size);
    } else if (status == FMI_OK && get_u64(bytes + AT_CHECKSUM) != checksum(bytes, size)) {
        status = fmi_fail(f, call, "the checksum does not fit: the saved state was damaged, or is of another version of the model");
    } else if (status == FMI_OK) {
        status = check_header(f, call, bytes);
    }
    /* Always a new block: what the importer's handle held before may be anything. */
    void *block = NULL;
    if (status == FMI_OK) {
        status = make_room(f, call, &block, size);
    }
    if (status == FMI_OK) {
        memcpy(((saved_block *)block)->bytes, bytes, size);
        *saved = block;
    }
    return status;
}
