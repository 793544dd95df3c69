/* Start values that an FMU brings beside its library, in resources/starts.txt, so that another sensor takes no compiler: a line each,

       name bits

   name: of an input or parameter; bits: of the double in SI, 16 hexadecimal digits, the same in every locale; what follows is for readers.
   The token is then gyro_token, '+' and the hash of the file, 16 hexadecimal digits: a file that the modelDescription.xml does not belong to is
   refused. */

#include "fmi_common.h"

#include <stdio.h>
#include <string.h>

#include "gyro_math.h"

/* Bytes of a path, of a file, of a name. */
enum { PATH_SIZE = 4096, FILE_SIZE = 32768, NAME_SIZE = 64, HEX_DIGITS = 16 };

static const char FILE_NAME[] = "starts.txt";

static int digit_of(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Reads the number of 16 hexadecimal digits in a text that ends; 0 where they are none. */
static int read_hex(const char *text, uint64_t *number)
{
    int fits = 1;
    *number = 0;
    for (int i = 0; i < HEX_DIGITS && fits; i++) {
        const int digit = digit_of(text[i]);
        fits = digit >= 0;
        *number = *number << 4 | (uint64_t)(fits ? digit : 0);
    }
    return fits;
}

/* FNV-1a, 64 bit. */
static uint64_t hash_of_text(const char *bytes, size_t size)
{
    uint64_t value = UINT64_C(0xcbf29ce484222325);
    for (size_t i = 0; i < size; i++) {
        value = (value ^ (unsigned char)bytes[i]) * UINT64_C(0x100000001b3);
    }
    return value;
}

/* The path of the file from where the importer says that resources/ is: a path (FMI 3.0) or a URI (FMI 2.0). 0 where it is too long. */
static int find_path(const char *resources, char path[PATH_SIZE])
{
    size_t n = 0;
    const char *at = resources;
    const int uri = strncmp(at, "file:", 5) == 0;
    if (uri) {
        at += strncmp(at, "file://", 7) == 0 ? 7 : 5;
        at += strncmp(at, "localhost/", 10) == 0 ? 9 : 0;
        /* file:///C:/ */
        at += at[0] == '/' && at[1] != '\0' && at[2] == ':' ? 1 : 0;
    }
    while (*at != '\0' && n + 2 < PATH_SIZE) {
        const int high = uri && at[0] == '%' ? digit_of(at[1]) : -1;
        const int low = high >= 0 ? digit_of(at[2]) : -1;
        path[n++] = low >= 0 ? (char)(16 * high + low) : *at;
        at += low >= 0 ? 3 : 1;
    }
    const int fits = *at == '\0' && n + sizeof FILE_NAME + 1 < PATH_SIZE;
    if (fits) {
        if (n > 0 && path[n - 1] != '/' && path[n - 1] != '\\') {
            path[n++] = '/';
        }
        memcpy(path + n, FILE_NAME, sizeof FILE_NAME);
    }
    return fits;
}

/* The bytes of the file, at most FILE_SIZE, and '\0' behind them; -1 where it can't be read or is longer. */
static long read_file(const char *path, char text[FILE_SIZE + 1])
{
    long size = -1;
#if defined(__wasm__)
    /* A web page has no files; it sets the parameters. */
    (void)path, (void)text;
#else
    FILE *file = fopen(path, "rb");
    if (file != NULL) {
        const size_t read = fread(text, 1, FILE_SIZE + 1, file);
        if (read <= FILE_SIZE && !ferror(file)) {
            size = (long)read;
            text[read] = '\0';
        }
        fclose(file);
    }
#endif
    return size;
}

static uint32_t variable_of(const char *name, size_t size)
{
    uint32_t vr = 0;
    while (vr < GYRO_N_VARIABLES && (strlen(gyro_variables[vr].name) != size || memcmp(gyro_variables[vr].name, name, size) != 0)) {
        vr++;
    }
    return vr;
}

/* Takes a line of at least no characters, which ends at '\n' or '\0'. */
static fmi_status take_line(fmi_instance *f, const char *call, const char *line)
{
    fmi_status status = FMI_OK;
    const size_t name = strcspn(line, " \n");
    const uint32_t vr = name < NAME_SIZE ? variable_of(line, name) : GYRO_N_VARIABLES;
    uint64_t bits = 0;
    if (vr == GYRO_N_VARIABLES || gyro_variables[vr].kind == GYRO_OUTPUT) {
        status = fmi_fail(f, call, "%s: \"%.*s\" is no input or parameter", FILE_NAME, (int)(name < NAME_SIZE ? name : NAME_SIZE), line);
    } else if (line[name] != ' ' || !read_hex(line + name + 1, &bits)) {
        status = fmi_fail(f, call, "%s: %s has no %d hexadecimal digits", FILE_NAME, gyro_variables[vr].name, HEX_DIGITS);
    } else {
        const gyro_variable *variable = &gyro_variables[vr];
        double value;
        memcpy(&value, &bits, sizeof value);
        const int whole = variable->type == GYRO_REAL || value == gyro_floor(value);
        if (!(value >= variable->min && value <= variable->max && whole)) {
            status = fmi_fail(f, call, "%s: %s = %.9g; give a value from %.9g to %.9g", FILE_NAME, variable->name, value, variable->min,
                              variable->max);
        } else {
            f->start[vr] = value;
        }
    }
    return status;
}

static fmi_status take_text(fmi_instance *f, const char *call, const char *text)
{
    fmi_status status = FMI_OK;
    for (uint32_t vr = 0; vr < GYRO_N_VARIABLES; vr++) {
        f->start[vr] = gyro_variables[vr].start;
    }
    while (*text != '\0' && status == FMI_OK) {
        status = take_line(f, call, text);
        text += strcspn(text, "\n");
        text += *text == '\n';
    }
    f->has_starts = status == FMI_OK;
    return status;
}

static fmi_status read_starts(fmi_instance *f, const fmi_request *r, uint64_t hash)
{
    char path[PATH_SIZE], text[FILE_SIZE + 1];
    fmi_status status = FMI_OK;
    long size = -1;
    if (r->resources == NULL || !find_path(r->resources, path)) {
        status = fmi_fail(f, r->call, "this FMU brings start values in resources/%s; say where the folder is", FILE_NAME);
    } else if ((size = read_file(path, text)) < 0) {
        status = fmi_fail(f, r->call, "%.200s can't be read, or is longer than %d bytes", path, FILE_SIZE);
    } else if (hash_of_text(text, (size_t)size) != hash || strlen(text) != (size_t)size) {
        status = fmi_fail(f, r->call, "%.200s is not the file that modelDescription.xml belongs to; unpack the FMU anew", path);
    } else {
        status = take_text(f, r->call, text);
    }
    return status;
}

fmi_status fmi_check_token(fmi_instance *f, const fmi_request *r)
{
    const char *token = r->token != NULL ? r->token : "NULL";
    const size_t own = strlen(gyro_token);
    const char *more = strncmp(token, gyro_token, own) == 0 ? token + own : NULL;
    uint64_t hash = 0;
    fmi_status status = FMI_OK;
    if (more == NULL || (*more != '\0' && !(strlen(more) == HEX_DIGITS + 1 && *more == '+' && read_hex(more + 1, &hash)))) {
        status = fmi_fail(f, r->call, "the token is %.60s, this library belongs to %s; use the modelDescription.xml of the same FMU", token,
                          gyro_token);
    } else if (*more != '\0') {
        status = read_starts(f, r, hash);
    }
    return status;
}
