/* Plays scenarios on the library of an FMI 3.0 FMU and prints what came out as hashes, so that platforms can be compared to the bit.
   Argument: the library. Input, numbers as the 16 hexadecimal digits of a double's bits:

       TOKEN N_OUTPUTS reference ...
       NAME N_INPUTS reference scale ... N_INPUTS reference offset ... N_PARAMETERS reference value ... SEED_REFERENCE SEED STEPS step

   and more of the second kind of line. Output: name, steps done, hash of the outputs, hash of the saved state (0 where a step diverged). Input i is set to offset + scale ((37 k + 11 i) mod 17 - 8)
   before step k. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { MOST = 512 };

/* A list of variables and a number for each. */
typedef struct {
    size_t n;
    fmi3ValueReference reference[MOST];
    double value[MOST];
} list;

#define FUNCTION(name) static fmi3##name##TYPE *name
FUNCTION(InstantiateCoSimulation);
FUNCTION(FreeInstance);
FUNCTION(EnterInitializationMode);
FUNCTION(ExitInitializationMode);
FUNCTION(SetFloat64);
FUNCTION(SetInt32);
FUNCTION(GetFloat64);
FUNCTION(DoStep);
FUNCTION(GetFMUState);
FUNCTION(FreeFMUState);
FUNCTION(SerializedFMUStateSize);
FUNCTION(SerializeFMUState);
/* An object pointer becomes a function pointer, which C99 leaves to POSIX and Windows, through a copy of its bytes. */
#define LOAD(name) (*(void **)&name = find(library, "fmi3" #name))

static void fail(const char *what)
{
    fprintf(stderr, "play: %s\n", what);
    exit(1);
}

static double read_double(void)
{
    uint64_t bits;
    double x;
    if (scanf("%16" SCNx64, &bits) != 1) {
        fail("a number is missing");
    }
    memcpy(&x, &bits, sizeof x);
    return x;
}

static size_t read_count(size_t most)
{
    unsigned n;
    if (scanf("%u", &n) != 1 || n > most) {
        fail("a count is missing");
    }
    return n;
}

static void read_list(list *l, int with_values)
{
    l->n = read_count(MOST);
    for (size_t i = 0; i < l->n; i++) {
        l->reference[i] = (fmi3ValueReference)read_count(UINT32_MAX);
        l->value[i] = with_values ? read_double() : 0.0;
    }
}

/* FNV-1a, 64 bit. */
static uint64_t hash(uint64_t h, const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        h = (h ^ ((const unsigned char *)bytes)[i]) * UINT64_C(0x100000001b3);
    }
    return h;
}

static const uint64_t FIRST = UINT64_C(0xcbf29ce484222325);

static uint64_t hash_of_state(fmi3Instance instance)
{
    fmi3FMUState state = NULL;
    size_t size = 0;
    if (GetFMUState(instance, &state) != fmi3OK || SerializedFMUStateSize(instance, state, &size) != fmi3OK) {
        fail("the state is refused");
    }
    unsigned char *bytes = malloc(size);
    if (bytes == NULL || SerializeFMUState(instance, state, bytes, size) != fmi3OK) {
        fail("the state has no bytes");
    }
    const uint64_t h = hash(FIRST, bytes, size);
    free(bytes);
    FreeFMUState(instance, &state);
    return h;
}

static void play(const char *name, const char *token, list *outputs)
{
    static list inputs, offsets, parameters;
    read_list(&inputs, 1);
    read_list(&offsets, 1);
    read_list(&parameters, 1);
    const fmi3ValueReference seed_reference = (fmi3ValueReference)read_count(UINT32_MAX);
    const int32_t seed = (int32_t)read_count(INT32_MAX);
    const unsigned steps = (unsigned)read_count(UINT32_MAX);
    const double step = read_double();
    uint64_t h = FIRST;
    bool event, terminate, early;
    double reached;
    fmi3Instance c = InstantiateCoSimulation("play", token, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    if (c == NULL || SetFloat64(c, parameters.reference, parameters.n, parameters.value, parameters.n) != fmi3OK ||
        SetInt32(c, &seed_reference, 1, &seed, 1) != fmi3OK || EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0) != fmi3OK ||
        ExitInitializationMode(c) != fmi3OK) {
        fail(name);
    }
    unsigned k = 0;
    for (int ok = 1; k < steps && ok; k += ok != 0) {
        double set[MOST];
        for (unsigned i = 0; i < inputs.n; i++) {
            set[i] = offsets.value[i] + inputs.value[i] * ((double)((37u * k + 11u * i) % 17u) - 8.0);
        }
        ok = SetFloat64(c, inputs.reference, inputs.n, set, inputs.n) == fmi3OK &&
             DoStep(c, (double)k * step, step, true, &event, &terminate, &early, &reached) == fmi3OK;
        if (GetFloat64(c, outputs->reference, outputs->n, outputs->value, outputs->n) != fmi3OK) {
            fail(name);
        }
        h = ok ? hash(h, outputs->value, outputs->n * sizeof(double)) : h;
    }
    /* The bits of NaN differ between processors. */
    printf("%s %u %016" PRIx64 " %016" PRIx64 "\n", name, k, h, k == steps ? hash_of_state(c) : UINT64_C(0));
    FreeInstance(c);
}

int main(int argc, char **argv)
{
    static list outputs;
    char token[80], name[80];
    void *library = argc == 2 ? open_library(argv[1]) : NULL;
    if (library == NULL) {
        fail("no library");
    }
    LOAD(InstantiateCoSimulation), LOAD(FreeInstance), LOAD(EnterInitializationMode), LOAD(ExitInitializationMode);
    LOAD(SetFloat64), LOAD(SetInt32), LOAD(GetFloat64), LOAD(DoStep);
    LOAD(GetFMUState), LOAD(FreeFMUState), LOAD(SerializedFMUStateSize), LOAD(SerializeFMUState);
    if (scanf("%79s", token) != 1) {
        fail("no token");
    }
    read_list(&outputs, 0);
    while (scanf("%79s", name) == 1) {
        play(name, token, &outputs);
    }
    return 0;
}
