/* The WebAssembly component of an FMU, by the draft of FMI's layered standard fmi-ls-wasm: its methods over the functions of FMI 3.0.

   Values cross its border by the canonical ABI of the Component Model. A list or string is an address and a length; those that come in lie in blocks
   from component_realloc and are freed here. What goes out lies in the instance until the next call; the layout of a record is that of a C struct on
   wasm32. gyro_model/component.py wraps the compiled module; a method is exported under the name that it has in gyro_model/component_interface.py. */

#include <fmi3Functions.h>

#include <stdlib.h>
#include <string.h>

#include "fmi_common.h"

#define EXPORT(name) __attribute__((export_name(name)))
#define IMPORT(name) __attribute__((import_module("env"), import_name(name)))

/* A string or a list of bytes. */
typedef struct {
    char *bytes;
    size_t n;
} component_view;

/* result<T, status>, by the alignment of T: of lists ... */
typedef struct {
    fmi3Boolean failed;
    union {
        unsigned char status;
        struct {
            const void *items;
            size_t n;
        } list;
    } as;
} component_list;

/* ... of what holds a number of 8 bytes, field by field as the interface names them ... */
typedef struct {
    fmi3Boolean failed;
    union {
        unsigned char status;
        fmi3UInt64 count;
        struct {
            fmi3Boolean needed, terminate, nominals, values, next_defined;
            fmi3Float64 next;
        } discrete;
        struct {
            fmi3Float64 reached;
            fmi3Boolean event, terminate, early;
        } step;
    } as;
} component_number;

/* ... and of flags. */
typedef struct {
    fmi3Boolean failed;
    union {
        unsigned char status;
        struct {
            fmi3Boolean event_mode, terminate;
        } step;
    } as;
} component_flags;

/* option<T> of a resource: `self` becomes a handle on the way out. */
struct component_instance;
typedef struct {
    fmi3Boolean is;
    struct component_instance *self;
} component_option;

typedef struct component_instance {
    fmi3Instance fmu;
    char *name; /* that the importer gave it */
    void *room; /* for what lists return */
    size_t room_size;
    component_option option;
    component_list list;
    component_number number;
    component_flags flags;
} component_instance;

/* tuple<bool, f64> */
typedef struct {
    fmi3Boolean requested;
    fmi3Float64 time;
} component_end;

IMPORT("log-message")
void component_log_message(const char *name, size_t name_size, fmi3Status status, const char *category, size_t category_size, const char *message,
                           size_t message_size);
IMPORT("intermediate-update")
void component_intermediate_update(fmi3Float64 time, fmi3Boolean set_requested, fmi3Boolean get_allowed, fmi3Boolean step_finished,
                                   fmi3Boolean can_return_early, component_end *end);

/* Memory for what comes in. There is no way to refuse it: without memory the component ends. */
EXPORT("cabi_realloc")
void *component_realloc(void *old, size_t old_size, size_t alignment, size_t size)
{
    void *block = size > 0 ? realloc(old_size > 0 ? old : NULL, size) : (void *)alignment;
    if (block == NULL) {
        __builtin_trap();
    }
    return block;
}

static void component_free_items(void *items, size_t n)
{
    if (n > 0) {
        free(items);
    }
}

static void component_free_views(component_view views[], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        component_free_items(views[i].bytes, views[i].n);
    }
    component_free_items(views, n);
}

/* The same string with '\0' behind it, always to be freed. */
static char *component_terminated(char *bytes, size_t n)
{
    char *text = component_realloc(bytes, n, 1, n + 1);
    text[n] = '\0';
    return text;
}

/* Room for n items; NULL where there is no memory, which the functions of FMI refuse with a message. */
static void *component_room(component_instance *self, size_t n, size_t size)
{
    if (n > SIZE_MAX / size) {
        return NULL;
    }
    if (n * size > self->room_size) {
        free(self->room);
        self->room = malloc(n * size);
        self->room_size = self->room != NULL ? n * size : 0;
    }
    return self->room;
}

static fmi3Boolean component_failed(fmi3Status status) { return status > fmi3Warning; }

static const component_list *component_list_of(component_instance *self, fmi3Status status, size_t n)
{
    self->list.failed = component_failed(status);
    if (self->list.failed) {
        self->list.as.status = (unsigned char)status;
    } else {
        self->list.as.list.items = self->room;
        self->list.as.list.n = n;
    }
    return &self->list;
}

static const component_number *component_number_of(component_instance *self, fmi3Status status)
{
    self->number.failed = component_failed(status);
    if (self->number.failed) {
        self->number.as.status = (unsigned char)status;
    }
    return &self->number;
}

/* A string of the interface is UTF-8, or the importer ends the component. Messages are ASCII but where they repeat the importer's text, perhaps cut within
   a character. */
static void component_log(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    const component_instance *self = environment;
    char *text = component_terminated(NULL, strlen(message));
    for (size_t i = 0; message[i] != '\0'; i++) {
        text[i] = (unsigned char)message[i] < 0x80 ? message[i] : '?';
    }
    component_log_message(self->name, strlen(self->name), status, category, strlen(category), text, strlen(message));
    free(text);
}

static void component_update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested, fmi3Boolean get_allowed,
                             fmi3Boolean step_finished, fmi3Boolean can_return_early, fmi3Boolean *requested, fmi3Float64 *end)
{
    component_end answer = {fmi3False, 0.0};
    (void)environment;
    component_intermediate_update(time, set_requested, get_allowed, step_finished, can_return_early, &answer);
    *requested = answer.requested;
    *end = answer.time;
}

EXPORT("get-version")
const component_view *component_get_version(void)
{
    static const component_view version = {fmi3Version, sizeof fmi3Version - 1};
    return &version;
}

static component_instance *component_new(char *name, size_t name_size)
{
    component_instance *self = calloc(1, sizeof *self);
    if (self == NULL) {
        __builtin_trap();
    }
    self->name = component_terminated(name, name_size);
    return self;
}

EXPORT("drop")
void component_drop(component_instance *self)
{
    fmi3FreeInstance(self->fmu);
    free(self->room);
    free(self->name);
    free(self);
}

static const component_option *component_made(component_instance *self, char *token, char *resources)
{
    static const component_option none = {fmi3False, NULL};
    const component_option *made = &none;
    if (self->fmu != NULL) {
        self->option = (component_option){fmi3True, self};
        made = &self->option;
    } else {
        component_drop(self);
    }
    free(token);
    free(resources);
    return made;
}

EXPORT("instantiate-co-simulation")
const component_option *component_instantiate_co_simulation(char *name, size_t name_size, char *token, size_t token_size, char *resources,
                                                            size_t resources_size, fmi3Boolean visible, fmi3Boolean logging_on,
                                                            fmi3Boolean event_mode_used, fmi3Boolean early_return_allowed,
                                                            fmi3ValueReference required[], size_t n_required)
{
    component_instance *self = component_new(name, name_size);
    token = component_terminated(token, token_size);
    resources = component_terminated(resources, resources_size);
    /* The draft asks an importer for intermediate updates only where it allows early returns. */
    self->fmu = fmi3InstantiateCoSimulation(self->name, token, resources, visible, logging_on, event_mode_used, early_return_allowed, required,
                                            n_required, self, component_log, early_return_allowed ? component_update : NULL);
    component_free_items(required, n_required);
    return component_made(self, token, resources);
}

EXPORT("instantiate-model-exchange")
const component_option *component_instantiate_model_exchange(char *name, size_t name_size, char *token, size_t token_size, char *resources,
                                                             size_t resources_size, fmi3Boolean visible, fmi3Boolean logging_on)
{
    component_instance *self = component_new(name, name_size);
    token = component_terminated(token, token_size);
    resources = component_terminated(resources, resources_size);
    self->fmu = fmi3InstantiateModelExchange(self->name, token, resources, visible, logging_on, self, component_log);
    return component_made(self, token, resources);
}

EXPORT("set-debug-logging")
fmi3Status component_set_debug_logging(component_instance *self, fmi3Boolean logging_on, component_view categories[], size_t n)
{
    fmi3String *names = n > 0 ? component_realloc(NULL, 0, sizeof *names, n * sizeof *names) : NULL;
    for (size_t i = 0; i < n; i++) {
        categories[i].bytes = component_terminated(categories[i].bytes, categories[i].n);
        categories[i].n++;
        names[i] = categories[i].bytes;
    }
    const fmi3Status status = fmi3SetDebugLogging(self->fmu, logging_on, n, names);
    free(names);
    component_free_views(categories, n);
    return status;
}

EXPORT("enter-initialization-mode")
fmi3Status component_enter_initialization_mode(component_instance *self, fmi3Boolean tolerance_defined, fmi3Float64 tolerance, fmi3Float64 start_time,
                                               fmi3Boolean stop_time_defined, fmi3Float64 stop_time)
{
    return fmi3EnterInitializationMode(self->fmu, tolerance_defined, tolerance, start_time, stop_time_defined, stop_time);
}

/* Methods without arguments that give a status. */
#define COMPONENT_CALL(name, function) \
    EXPORT(name) fmi3Status component_##function(component_instance *self) { return fmi3##function(self->fmu); }

COMPONENT_CALL("exit-initialization-mode", ExitInitializationMode)
COMPONENT_CALL("enter-event-mode", EnterEventMode)
COMPONENT_CALL("terminate", Terminate)
COMPONENT_CALL("reset", Reset)
COMPONENT_CALL("enter-configuration-mode", EnterConfigurationMode)
COMPONENT_CALL("exit-configuration-mode", ExitConfigurationMode)
COMPONENT_CALL("evaluate-discrete-states", EvaluateDiscreteStates)
COMPONENT_CALL("enter-step-mode", EnterStepMode)
COMPONENT_CALL("enter-continuous-time-mode", EnterContinuousTimeMode)

/* Values of the type T, which take as many bytes in a list as in C. */
#define COMPONENT_VALUES(name, T)                                                                                                \
    EXPORT("get-" name)                                                                                                          \
    const component_list *component_get_##T(component_instance *self, fmi3ValueReference vr[], size_t n)                         \
    {                                                                                                                            \
        const fmi3Status status = fmi3Get##T(self->fmu, vr, n, component_room(self, n, sizeof(fmi3##T)), n);                     \
        component_free_items(vr, n);                                                                                             \
        return component_list_of(self, status, n);                                                                               \
    }                                                                                                                            \
    EXPORT("set-" name)                                                                                                          \
    fmi3Status component_set_##T(component_instance *self, fmi3ValueReference vr[], size_t n, fmi3##T values[], size_t n_values) \
    {                                                                                                                            \
        const fmi3Status status = fmi3Set##T(self->fmu, vr, n, values, n_values);                                                \
        component_free_items(vr, n);                                                                                             \
        component_free_items(values, n_values);                                                                                  \
        return status;                                                                                                           \
    }

COMPONENT_VALUES("float32", Float32)
COMPONENT_VALUES("float64", Float64)
COMPONENT_VALUES("int8", Int8)
COMPONENT_VALUES("int16", Int16)
COMPONENT_VALUES("int32", Int32)
COMPONENT_VALUES("int64", Int64)
COMPONENT_VALUES("uint8", UInt8)
COMPONENT_VALUES("uint16", UInt16)
COMPONENT_VALUES("uint32", UInt32)
COMPONENT_VALUES("uint64", UInt64)
COMPONENT_VALUES("boolean", Boolean)

EXPORT("get-clock")
const component_list *component_get_clock(component_instance *self, fmi3ValueReference vr[], size_t n)
{
    const fmi3Status status = fmi3GetClock(self->fmu, vr, n, component_room(self, n, sizeof(fmi3Clock)));
    component_free_items(vr, n);
    return component_list_of(self, status, n);
}

/* Of what these FMUs have none: text, bytes, clocks that are set, intervals. FMI's function gets no arrays, which it does not look at, and gives OK
   for an empty list at most. */
#define COMPONENT_GETS_NONE(name, function, ...)                                                                         \
    EXPORT(name) const component_list *component_##function(component_instance *self, fmi3ValueReference vr[], size_t n) \
    {                                                                                                                    \
        const fmi3Status status = fmi3##function(self->fmu, vr, n, __VA_ARGS__);                                         \
        component_free_items(vr, n);                                                                                     \
        return component_list_of(self, status, 0);                                                                       \
    }
#define COMPONENT_SETS_NONE(name, function, items, free_values, ...)                                                                           \
    EXPORT(name) fmi3Status component_##function(component_instance *self, fmi3ValueReference vr[], size_t n, items values[], size_t n_values) \
    {                                                                                                                                          \
        const fmi3Status status = fmi3##function(self->fmu, vr, n, __VA_ARGS__);                                                               \
        component_free_items(vr, n);                                                                                                           \
        free_values(values, n_values);                                                                                                         \
        return status;                                                                                                                         \
    }

COMPONENT_GETS_NONE("get-string", GetString, NULL, n)
COMPONENT_GETS_NONE("get-binary", GetBinary, NULL, NULL, n)
COMPONENT_GETS_NONE("get-interval-decimal", GetIntervalDecimal, NULL, NULL)
COMPONENT_GETS_NONE("get-interval-fraction", GetIntervalFraction, NULL, NULL, NULL)
COMPONENT_GETS_NONE("get-shift-decimal", GetShiftDecimal, NULL)
COMPONENT_GETS_NONE("get-shift-fraction", GetShiftFraction, NULL, NULL)
COMPONENT_SETS_NONE("set-string", SetString, component_view, component_free_views, NULL, n_values)
COMPONENT_SETS_NONE("set-binary", SetBinary, component_view, component_free_views, NULL, NULL, n_values)
COMPONENT_SETS_NONE("set-clock", SetClock, fmi3Clock, component_free_items, NULL)
COMPONENT_SETS_NONE("set-interval-decimal", SetIntervalDecimal, fmi3Float64, component_free_items, NULL)
COMPONENT_SETS_NONE("set-interval-fraction", SetIntervalFraction, fmi3UInt64, component_free_items, NULL, NULL)
COMPONENT_SETS_NONE("set-shift-decimal", SetShiftDecimal, fmi3Float64, component_free_items, NULL)
COMPONENT_SETS_NONE("set-shift-fraction", SetShiftFraction, fmi3UInt64, component_free_items, NULL, NULL)

EXPORT("get-number-of-variable-dependencies")
const component_number *component_get_number_of_variable_dependencies(component_instance *self, fmi3ValueReference vr)
{
    size_t n = 0;
    const fmi3Status status = fmi3GetNumberOfVariableDependencies(self->fmu, vr, &n);
    self->number.as.count = n;
    return component_number_of(self, status);
}

EXPORT("get-variable-dependencies")
const component_list *component_get_variable_dependencies(component_instance *self, fmi3ValueReference dependent)
{
    return component_list_of(self, fmi3GetVariableDependencies(self->fmu, dependent, NULL, NULL, NULL, NULL, 0), 0);
}

/* The draft's requests are pairs of a variable and an order. */
EXPORT("get-output-derivatives")
const component_list *component_get_output_derivatives(component_instance *self, fmi3ValueReference requests[], size_t n)
{
    const fmi3Status status = fmi3GetOutputDerivatives(self->fmu, NULL, n, NULL, NULL, n);
    component_free_items(requests, n);
    return component_list_of(self, status, 0);
}

EXPORT("set-input-derivatives")
fmi3Status component_set_input_derivatives(component_instance *self, fmi3ValueReference requests[], size_t n, fmi3Float64 values[], size_t n_values)
{
    component_free_items(requests, n);
    component_free_items(values, n_values);
    return (fmi3Status)fmi_fail(self->fmu, "set-input-derivatives", "FMI 3.0 has no derivatives of inputs; set inputs more often");
}

EXPORT("get-fmu-state")
const component_list *component_get_fmu_state(component_instance *self)
{
    fmi3FMUState state = NULL;
    size_t size = 0;
    fmi3Status status = fmi3GetFMUState(self->fmu, &state);
    if (status == fmi3OK && (status = fmi3SerializedFMUStateSize(self->fmu, state, &size)) == fmi3OK) {
        status = fmi3SerializeFMUState(self->fmu, state, component_room(self, size, 1), size);
    }
    if (state != NULL) {
        fmi3FreeFMUState(self->fmu, &state);
    }
    return component_list_of(self, status, size);
}

EXPORT("set-fmu-state")
fmi3Status component_set_fmu_state(component_instance *self, fmi3Byte bytes[], size_t n)
{
    fmi3FMUState state = NULL;
    fmi3Status status = fmi3DeserializeFMUState(self->fmu, n > 0 ? bytes : NULL, n, &state);
    if (status == fmi3OK) {
        status = fmi3SetFMUState(self->fmu, state);
    }
    if (state != NULL) {
        fmi3FreeFMUState(self->fmu, &state);
    }
    component_free_items(bytes, n);
    return status;
}

/* Every variable is a scalar: forward a derivative for each unknown, adjoint for each known. */
#define COMPONENT_DERIVATIVE(name, function, n_results)                                                                         \
    EXPORT(name)                                                                                                                \
    const component_list *component_##function(component_instance *self, fmi3ValueReference unknowns[], size_t n_unknowns,      \
                                               fmi3ValueReference knowns[], size_t n_knowns, fmi3Float64 seed[], size_t n_seed) \
    {                                                                                                                           \
        const fmi3Status status = fmi3##function(self->fmu, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed,               \
                                                 component_room(self, n_results, sizeof(fmi3Float64)), n_results);              \
        component_free_items(unknowns, n_unknowns);                                                                             \
        component_free_items(knowns, n_knowns);                                                                                 \
        component_free_items(seed, n_seed);                                                                                     \
        return component_list_of(self, status, n_results);                                                                      \
    }

COMPONENT_DERIVATIVE("get-directional-derivative", GetDirectionalDerivative, n_unknowns)
COMPONENT_DERIVATIVE("get-adjoint-derivative", GetAdjointDerivative, n_knowns)

EXPORT("update-discrete-states")
const component_number *component_update_discrete_states(component_instance *self)
{
    component_number *r = &self->number;
    memset(&r->as.discrete, 0, sizeof r->as.discrete);
    const fmi3Status status =
        fmi3UpdateDiscreteStates(self->fmu, &r->as.discrete.needed, &r->as.discrete.terminate, &r->as.discrete.nominals, &r->as.discrete.values,
                                 &r->as.discrete.next_defined, &r->as.discrete.next);
    return component_number_of(self, status);
}

EXPORT("do-step")
const component_number *component_do_step(component_instance *self, fmi3Float64 from, fmi3Float64 step, fmi3Boolean no_set_state_prior)
{
    component_number *r = &self->number;
    const fmi3Status status = fmi3DoStep(self->fmu, from, step, no_set_state_prior, &r->as.step.event, &r->as.step.terminate, &r->as.step.early,
                                         &r->as.step.reached);
    return component_number_of(self, status);
}

/* Model exchange. */

EXPORT("set-time")
fmi3Status component_set_time(component_instance *self, fmi3Float64 time) { return fmi3SetTime(self->fmu, time); }

EXPORT("set-continuous-states")
fmi3Status component_set_continuous_states(component_instance *self, fmi3Float64 states[], size_t n)
{
    const fmi3Status status = fmi3SetContinuousStates(self->fmu, states, n);
    component_free_items(states, n);
    return status;
}

#define COMPONENT_ARRAY(name, function, count)                                                   \
    EXPORT(name) const component_list *component_##function(component_instance *self)            \
    {                                                                                            \
        size_t n = 0;                                                                            \
        fmi3Status status = fmi3##count(self->fmu, &n);                                          \
        if (!component_failed(status)) {                                                         \
            status = fmi3##function(self->fmu, component_room(self, n, sizeof(fmi3Float64)), n); \
        }                                                                                        \
        return component_list_of(self, status, n);                                               \
    }
#define COMPONENT_COUNT(name, function)                                                 \
    EXPORT(name) const component_number *component_##function(component_instance *self) \
    {                                                                                   \
        size_t n = 0;                                                                   \
        const fmi3Status status = fmi3##function(self->fmu, &n);                        \
        self->number.as.count = n;                                                      \
        return component_number_of(self, status);                                       \
    }

COMPONENT_ARRAY("get-continuous-state-derivatives", GetContinuousStateDerivatives, GetNumberOfContinuousStates)
COMPONENT_ARRAY("get-continuous-states", GetContinuousStates, GetNumberOfContinuousStates)
COMPONENT_ARRAY("get-nominals-of-continuous-states", GetNominalsOfContinuousStates, GetNumberOfContinuousStates)
COMPONENT_ARRAY("get-event-indicators", GetEventIndicators, GetNumberOfEventIndicators)
COMPONENT_COUNT("get-number-of-event-indicators", GetNumberOfEventIndicators)
COMPONENT_COUNT("get-number-of-continuous-states", GetNumberOfContinuousStates)

EXPORT("completed-integrator-step")
const component_flags *component_completed_integrator_step(component_instance *self, fmi3Boolean no_set_state_prior)
{
    component_flags *r = &self->flags;
    const fmi3Status status = fmi3CompletedIntegratorStep(self->fmu, no_set_state_prior, &r->as.step.event_mode, &r->as.step.terminate);
    r->failed = component_failed(status);
    if (r->failed) {
        r->as.status = (unsigned char)status;
    }
    return r;
}
