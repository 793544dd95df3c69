/* The plant call as a C program makes it: opens the library of an FMI 3.0 FMU, and sets, steps and gets in a loop. */

#include <stdint.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define EXPORT __declspec(dllexport)
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
#define EXPORT __attribute__((visibility("default")))
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

typedef struct {
    fmi3Instance instance;
    fmi3SetFloat64TYPE *set;
    fmi3DoStepTYPE *step;
    fmi3GetFloat64TYPE *get;
    fmi3FreeInstanceTYPE *release;
} driver;

/* An object pointer becomes a function pointer, which C99 leaves to POSIX and Windows, through a copy of its bytes. */
#define LOAD(target, library, name) (*(void **)&(target) = find(library, name))

/* An initialised instance of the FMU in the library at `path`, its parameters set [SI] and its seed, where `seeded` is its value reference and
   not UINT32_MAX; NULL where any step fails. */
EXPORT driver *driver_open(const char *path, const char *token, const uint32_t *references, const double *values, size_t count, uint32_t seeded,
                           int32_t seed)
{
    fmi3SetInt32TYPE *set_whole;
    fmi3InstantiateCoSimulationTYPE *instantiate;
    fmi3EnterInitializationModeTYPE *enter;
    fmi3ExitInitializationModeTYPE *leave;
    void *library = open_library(path);
    driver *d = calloc(1, sizeof *d);
    if (library == NULL || d == NULL) {
        free(d);
        return NULL;
    }
    LOAD(instantiate, library, "fmi3InstantiateCoSimulation");
    LOAD(enter, library, "fmi3EnterInitializationMode");
    LOAD(leave, library, "fmi3ExitInitializationMode");
    LOAD(set_whole, library, "fmi3SetInt32");
    LOAD(d->set, library, "fmi3SetFloat64");
    LOAD(d->step, library, "fmi3DoStep");
    LOAD(d->get, library, "fmi3GetFloat64");
    LOAD(d->release, library, "fmi3FreeInstance");
    d->instance = instantiate("driver", token, NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);
    if (d->instance == NULL || d->set(d->instance, references, count, values, count) > fmi3Warning ||
        (seeded != UINT32_MAX && set_whole(d->instance, &seeded, 1, &seed, 1) > fmi3Warning) ||
        enter(d->instance, 0, 0.0, 0.0, 0, 0.0) > fmi3Warning || leave(d->instance) > fmi3Warning) {
        free(d);
        return NULL;
    }
    return d;
}

/* Steps first .. first + count - 1 of `period` [s] each; gives the number done. Inputs [SI], shape (rows, n_in), are set and outputs [SI] got
   at each, a row a time, in turns. */
EXPORT int64_t driver_run(driver *d, int64_t first, int64_t count, double period, const uint32_t *inputs, const double *input_values,
                          int64_t rows, size_t n_in, const uint32_t *outputs, size_t n_out, double *output_values)
{
    bool event, terminate, early;
    double reached;
    for (int64_t k = 0; k < count; k++) {
        const double t = (double)(first + k) * period;
        const double *row = input_values + (size_t)((first + k) % rows) * n_in;
        if (d->set(d->instance, inputs, n_in, row, n_in) > fmi3Warning ||
            d->step(d->instance, t, period, 0, &event, &terminate, &early, &reached) > fmi3Warning ||
            d->get(d->instance, outputs, n_out, output_values, n_out) > fmi3Warning) {
            return k;
        }
    }
    return count;
}

/* Rows of `per_row` steps each, of which the mean of the outputs is kept, shape (count, n_out); gives the number of rows done. */
EXPORT int64_t driver_means(driver *d, int64_t first, int64_t count, int64_t per_row, double period, const uint32_t *inputs,
                            const double *input_values, int64_t rows, size_t n_in, const uint32_t *outputs, size_t n_out, double *means)
{
    double latest[16];
    if (n_out > sizeof latest / sizeof *latest) {
        return 0;
    }
    for (int64_t k = 0; k < count; k++) {
        for (int64_t i = 0; i < per_row; i++) {
            if (driver_run(d, first + k * per_row + i, 1, period, inputs, input_values, rows, n_in, outputs, n_out, latest) != 1) {
                return k;
            }
            for (size_t j = 0; j < n_out; j++) {
                means[(size_t)k * n_out + j] += latest[j] / (double)per_row;
            }
        }
    }
    return count;
}

EXPORT void driver_close(driver *d)
{
    d->release(d->instance);
    free(d);
}
