/* A libFuzzer target: the bytes are calls of one FMU in any order, with numbers that are likely or not, and saved states that are as
   they were, cut, overwritten, or overwritten with their checksums mended. Compiled once for each FMU and each standard (FMI2 defined or not). */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "generated/model.h"

#ifdef FMI2
#include <fmi2Functions.h>
#define F(name) fmi2##name
#define SAVE fmi2GetFMUstate
#define RESTORE fmi2SetFMUstate
#define FREE_SAVED fmi2FreeFMUstate
#define SAVED_SIZE fmi2SerializedFMUstateSize
#define SERIALIZE(c, s, b, n) fmi2SerializeFMUstate(c, s, (fmi2Byte *)(b), n)
#define DESERIALIZE(c, b, n, s) fmi2DeSerializeFMUstate(c, (const fmi2Byte *)(b), n, s)
#define SET_REAL(c, vr, n, v) fmi2SetReal(c, vr, n, v)
#define GET_REAL(c, vr, n, v) fmi2GetReal(c, vr, n, v)
#define SET_INT(c, vr, n, v) fmi2SetInteger(c, vr, n, v)
#define GET_INT(c, vr, n, v) fmi2GetInteger(c, vr, n, v)
typedef fmi2Component instance;
typedef fmi2FMUstate saved;

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status;
    if (strlen(category) + strlen(text) == 0) {
        abort();
    }
}

static instance make(int logging, int wrong)
{
    static const fmi2CallbackFunctions callbacks = {log_message, NULL, NULL, NULL, NULL};
    return fmi2Instantiate("fuzz", wrong == 1 || wrong >= 4 ? fmi2ModelExchange : fmi2CoSimulation, wrong == 2 ? "{other}" : gyro_token, NULL,
                           wrong == 3 ? NULL : &callbacks, fmi2False, logging);
}

static void setup(instance c, int has_stop, double start, double stop)
{
    fmi2SetupExperiment(c, fmi2False, 0.0, start, has_stop, stop);
    fmi2EnterInitializationMode(c);
}

/* What an importer that integrates calls. */
static void integrate(instance c, unsigned which, const unsigned *vr, double x[GYRO_N_CONTINUOUS + 1], double time)
{
    fmi2EventInfo info;
    int event, terminate;
    switch (which % 9) {
    case 0: fmi2EnterEventMode(c); break;
    case 1: fmi2NewDiscreteStates(c, &info); break;
    case 2: fmi2EnterContinuousTimeMode(c); break;
    case 3: fmi2CompletedIntegratorStep(c, fmi2True, &event, &terminate); break;
    case 4: fmi2SetTime(c, time); break;
    case 5: if (fmi2GetContinuousStates(c, x, GYRO_N_CONTINUOUS) == fmi2OK) { x[*vr % GYRO_N_CONTINUOUS] += time; fmi2SetContinuousStates(c, x, GYRO_N_CONTINUOUS); } break;
    case 6: fmi2GetDerivatives(c, x, GYRO_N_CONTINUOUS); break;
    case 7: fmi2GetNominalsOfContinuousStates(c, x, GYRO_N_CONTINUOUS); fmi2GetEventIndicators(c, x, 0); break;
    default: { const unsigned output = GYRO_N_INPUTS; fmi2GetDirectionalDerivative(c, &output, 1, vr, 1, &time, x); fmi2GetDirectionalDerivative(c, vr, 1, vr, 1, &time, x); } break;
    }
}

static int step(instance c, double from, double by) { return fmi2DoStep(c, from, by, fmi2True); }

static double reached(instance c)
{
    double t = 0.0;
    fmi2Status status;
    fmi2GetStatus(c, fmi2DoStepStatus, &status);
    return fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &t) == fmi2OK ? t : 0.0;
}

static void others(instance c, unsigned which, const unsigned *vr)
{
    double x[8] = {0.0};
    int truth = 0;
    const char *text = "logAll";
    switch (which % 8) {
    case 0: fmi2SetDebugLogging(c, fmi2True, 1, &text); break;
    case 1: fmi2GetBoolean(c, vr, 1, &truth); break;
    case 2: fmi2GetString(c, vr, 1, &text); break;
    case 3: fmi2CancelStep(c); break;
    case 4: fmi2SetRealInputDerivatives(c, vr, 1, &truth, x); break;
    case 5: fmi2GetRealOutputDerivatives(c, vr, 1, &truth, x); break;
    case 6: fmi2GetBooleanStatus(c, fmi2Terminated, &truth); break;
    default: fmi2SetDebugLogging(c, fmi2False, 0, NULL); break;
    }
}
#else
#include <fmi3Functions.h>
#define F(name) fmi3##name
#define SAVE fmi3GetFMUState
#define RESTORE fmi3SetFMUState
#define FREE_SAVED fmi3FreeFMUState
#define SAVED_SIZE fmi3SerializedFMUStateSize
#define SERIALIZE(c, s, b, n) fmi3SerializeFMUState(c, s, b, n)
#define DESERIALIZE(c, b, n, s) fmi3DeserializeFMUState(c, b, n, s)
#define SET_REAL(c, vr, n, v) fmi3SetFloat64(c, vr, n, v, n)
#define GET_REAL(c, vr, n, v) fmi3GetFloat64(c, vr, n, v, n)
#define SET_INT(c, vr, n, v) fmi3SetInt32(c, vr, n, v, n)
#define GET_INT(c, vr, n, v) fmi3GetInt32(c, vr, n, v, n)
typedef fmi3Instance instance;
typedef fmi3FMUState saved;

static double latest = 0.0;
static unsigned updates = 0;
static instance stepping;

static void log_message(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String text)
{
    (void)e, (void)status;
    if (strlen(category) + strlen(text) == 0) {
        abort();
    }
}

static void update(fmi3InstanceEnvironment e, fmi3Float64 time, fmi3Boolean set, fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_end,
                   fmi3Boolean *end, fmi3Float64 *end_time)
{
    (void)e, (void)set, (void)finished;
    const fmi3ValueReference vr = (fmi3ValueReference)(updates % GYRO_N_VARIABLES);
    double x;
    if (get) {
        GET_REAL(stepping, &vr, 1, &x);
    }
    if (updates % 7 == 3) {
        SET_REAL(stepping, &vr, 1, &x);
    }
    *end = can_end && updates++ % 5 == 4;
    *end_time = time;
}

static instance make(int logging, int wrong)
{
    if (wrong >= 4) {
        return fmi3InstantiateModelExchange("fuzz", gyro_token, NULL, false, logging, NULL, log_message);
    }
    return fmi3InstantiateCoSimulation("fuzz", wrong == 2 ? "{other}" : gyro_token, NULL, false, logging, wrong == 1, logging, NULL, 0, NULL,
                                       wrong == 3 ? NULL : log_message, logging ? update : NULL);
}

static void setup(instance c, int has_stop, double start, double stop) { fmi3EnterInitializationMode(c, false, 0.0, start, has_stop, stop); }

/* What an importer that integrates calls. */
static void integrate(instance c, unsigned which, const unsigned *vr, double x[GYRO_N_CONTINUOUS + 1], double time)
{
    bool flags[5];
    size_t n = 0;
    switch (which % 9) {
    case 0: fmi3EnterEventMode(c); break;
    case 1: fmi3UpdateDiscreteStates(c, flags, flags + 1, flags + 2, flags + 3, flags + 4, x); break;
    case 2: if (*vr % 2) fmi3EnterContinuousTimeMode(c); else fmi3EnterStepMode(c); break;
    case 3: fmi3CompletedIntegratorStep(c, true, flags, flags + 1); fmi3EvaluateDiscreteStates(c); break;
    case 4: fmi3SetTime(c, time); break;
    case 5: if (fmi3GetContinuousStates(c, x, GYRO_N_CONTINUOUS) == fmi3OK) { x[*vr % GYRO_N_CONTINUOUS] += time; fmi3SetContinuousStates(c, x, GYRO_N_CONTINUOUS); } break;
    case 6: fmi3GetContinuousStateDerivatives(c, x, GYRO_N_CONTINUOUS); break;
    case 7: fmi3GetNominalsOfContinuousStates(c, x, GYRO_N_CONTINUOUS); fmi3GetEventIndicators(c, x, 0); fmi3GetNumberOfContinuousStates(c, &n); break;
    default: {
        const fmi3ValueReference output = GYRO_N_INPUTS;
        double back[8];
        fmi3GetDirectionalDerivative(c, &output, 1, vr, 1, &time, 1, x, 1);
        fmi3GetDirectionalDerivative(c, vr, 1, vr, 1, &time, 1, x, 1);
        fmi3GetAdjointDerivative(c, &output, 1, vr, 1, &time, 1, back, 1);
    } break;
    }
}

static int step(instance c, double from, double by)
{
    bool event, terminate, early;
    stepping = c;
    return fmi3DoStep(c, from, by, true, &event, &terminate, &early, &latest);
}

static double reached(instance c)
{
    const fmi3ValueReference time = GYRO_N_VARIABLES;
    double t = 0.0;
    return GET_REAL(c, &time, 1, &t) == fmi3OK ? t : 0.0;
}

static void others(instance c, unsigned which, const unsigned *vr)
{
    double x[8] = {0.0};
    float single = 0.0f;
    bool truth = false;
    size_t n = 0;
    const char *text = "logStatusError";
    switch (which % 8) {
    case 0: fmi3SetDebugLogging(c, true, 1, &text); break;
    case 1: fmi3GetBoolean(c, vr, 1, &truth, 1); break;
    case 2: fmi3GetString(c, vr, 1, &text, 1); break;
    case 3: fmi3GetFloat32(c, vr, 1, &single, 1); break;
    case 4: fmi3GetNumberOfVariableDependencies(c, *vr, &n); fmi3GetClock(c, vr, 1, &truth); break;
    case 5: fmi3GetFloat64(c, vr, 1, x, 2); break;
    case 6: fmi3EnterConfigurationMode(c); break;
    default: fmi3SetDebugLogging(c, false, 0, NULL); break;
    }
}
#endif

typedef struct {
    const unsigned char *at, *end;
} source;

static unsigned byte(source *s) { return s->at < s->end ? *s->at++ : 0u; }

static double number(source *s)
{
    static const double likely[] = {0.0,  1.0,  -1.0, 1e-6,  5e-6, 1e-5,  1e-9, 3.3e-6, 300.0,     0.5,     1e-3, 1e3,
                                    1e10, 1e18, 1e300, 1e-300, 1e-12, 1.7e9, NAN,  INFINITY, -INFINITY, 4.9e-324, 2.0,  1e-7};
    const unsigned kind = byte(s);
    double x = 0.0;
    if (kind < 64) {
        unsigned char raw[8];
        for (int i = 0; i < 8; i++) {
            raw[i] = (unsigned char)byte(s);
        }
        memcpy(&x, raw, sizeof x);
    } else if (kind < 160) {
        x = likely[kind % (sizeof likely / sizeof *likely)];
    } else {
        x = ((double)byte(s) - 128.0) * 1e-7 * (double)(kind - 159);
    }
    return x;
}

static uint64_t hash(uint64_t h, const unsigned char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        h = (h ^ bytes[i]) * UINT64_C(0x100000001b3);
    }
    return h;
}

/* Makes length and checksum of the two headers of a saved state fit (fmi_saved.c, snapshot.c). */
static void mend(unsigned char *bytes, size_t size)
{
    enum { OUTER = 48, INNER = 40 };
    const uint64_t first = UINT64_C(0xcbf29ce484222325), length = size, body = size - OUTER;
    if (size >= OUTER + INNER) {
        const uint64_t inner = hash(first, bytes + OUTER + INNER, size - OUTER - INNER);
        memcpy(bytes + OUTER + 24, &body, 8);
        memcpy(bytes + OUTER + 32, &inner, 8);
    }
    if (size >= OUTER) {
        memcpy(bytes + 8, &length, 8);
        const uint64_t outer = hash(hash(first, (const unsigned char *)gyro_token, strlen(gyro_token)), bytes + 24, size - 24);
        memcpy(bytes + 16, &outer, 8);
    }
}

enum { SLOTS = 3 };

/* A state's bytes, changed or not, into another slot. */
static void carry(instance c, source *s, saved slot[SLOTS])
{
    const unsigned how = byte(s), from = byte(s) % SLOTS, to = byte(s) % SLOTS;
    size_t size = 0;
    if (slot[from] == NULL || SAVED_SIZE(c, slot[from], &size) != F(OK)) {
        return;
    }
    const size_t room = size + 64;
    unsigned char *bytes = calloc(1, room);
    if (bytes != NULL && SERIALIZE(c, slot[from], bytes, size) == F(OK)) {
        for (unsigned n = how % 8; n > 0; n--) {
            const size_t at = (byte(s) | byte(s) << 8) % size;
            const double x = number(s);
            memcpy(bytes + at / 8 * 8, &x, at / 8 * 8 + 8 <= size ? 8 : size - at / 8 * 8);
        }
        if (how & 64) {
            size = size + 32 - byte(s) % 64;
        }
        if (how & 8) {
            mend(bytes, size);
        }
        saved made = NULL;
        if (DESERIALIZE(c, bytes, size, &made) == F(OK)) {
            FREE_SAVED(c, &slot[to]);
            slot[to] = made;
        }
    }
    free(bytes);
}

/* A step that ends: not more than some hundred pieces, or one that step_limit ends. */
static void move(instance c, source *s)
{
    static const unsigned pieces[] = {GYRO_INTERNAL_STEP, GYRO_SAMPLE_PERIOD};
    static const unsigned limit_at = GYRO_STEP_LIMIT;
    double piece[2] = {1.0, 1.0}, by = number(s), from = byte(s) % 8 == 0 ? number(s) : reached(c);
    int limit = 0;
    GET_REAL(c, pieces, 2, piece);
    GET_INT(c, &limit_at, 1, &limit);
    const double most = 64.0 * fmin(piece[0], piece[1]);
    if (by > most && !(limit > 0 && limit <= 200 && piece[1] >= 0.1 * piece[0])) {
        by = most;
    }
    step(c, from, by);
}

/* A call of those, at a time and with a change that may be sensible. */
static void exchange(instance c, unsigned which, const unsigned *vr, source *s)
{
    double x[GYRO_N_CONTINUOUS + 1] = {0.0};
    const double by = number(s);
    integrate(c, which, vr, x, which % 9 == 4 && (byte(s) & 3) != 0 ? reached(c) + by : by);
}

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size);

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size)
{
    source s = {data, data + size};
    saved slot[SLOTS] = {NULL};
    instance c = make(1, (int)(byte(&s) & 4)), other = NULL;
    while (s.at < s.end && c != NULL) {
        const unsigned op = byte(&s) % 23;
        const unsigned vr = byte(&s) % (GYRO_N_VARIABLES + 40);
        double x[GYRO_N_VARIABLES];
        int whole = (int)(byte(&s) | byte(&s) << 8) - 1000;
        saved *at = &slot[vr % SLOTS];
        switch (op) {
        case 0: F(FreeInstance)(other); other = make((int)(vr & 1), (int)(vr >> 1 & 7)); break;
        case 1: { const double start = number(&s), stop = number(&s); setup(c, (int)(vr & 1), start, stop); } break;
        case 2: setup(c, 0, 0.0, 0.0); break;
        case 3: F(ExitInitializationMode)(c); break;
        case 4: x[0] = number(&s); SET_REAL(c, &vr, 1, x); break;
        case 5: SET_INT(c, &vr, 1, &whole); break;
        case 6: GET_REAL(c, &vr, 1, x); break;
        case 7: GET_INT(c, &vr, 1, &whole); break;
        case 8: case 9: case 10: move(c, &s); break;
        case 11: SAVE(c, at); break;
        case 12: if (*at != NULL) RESTORE(c, *at); break;
        case 13: case 14: carry(c, &s, slot); break;
        case 15: FREE_SAVED(c, at); break;
        case 16: if (vr % 4 == 0) F(Terminate)(c); else if (vr % 4 == 1) F(Reset)(c); break;
        case 17: others(c, vr, &vr); break;
        case 20: case 21: case 22: exchange(c, vr, &vr, &s); break;
        case 18: if (other != NULL) { instance kept = c; c = other; other = kept; } break;
        default: { /* a life that gets somewhere */
            for (unsigned n = vr % 8; n > 0; n--) {
                const unsigned of = byte(&s) % GYRO_N_VARIABLES;
                x[0] = number(&s);
                SET_REAL(c, &of, 1, x);
            }
            setup(c, 0, 0.0, 0.0);
            F(ExitInitializationMode)(c);
        } break;
        }
    }
    for (int i = 0; i < SLOTS && c != NULL; i++) {
        FREE_SAVED(c, &slot[i]);
    }
    F(FreeInstance)(c);
    F(FreeInstance)(other);
    return 0;
}
