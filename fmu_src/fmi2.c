/* FMI 2.0: every function of fmi2Functions.h, over fmi_common.h.

   The memory callbacks are not used (FMI 2.0.2 deprecates them). What this FMU lacks (derivatives of inputs and outputs by time,
   asynchronous steps) is refused with a message, as modelDescription.xml announces. */

#include <fmi2Functions.h>

#include "fmi_common.h"

/* The log function takes a printf format, and many importers print it as it is: '%' is doubled for the former, and our texts avoid it. */
static void emit(const fmi_instance *f, fmi_status status, const char *category, const char *text)
{
    char format[2 * (GYRO_MESSAGE_SIZE + 160)];
    size_t n = 0;
    for (; *text != '\0' && n + 2 < sizeof format; text++) {
        if (*text == '%') {
            format[n++] = '%';
        }
        format[n++] = *text;
    }
    format[n] = '\0';
    ((fmi2CallbackLogger)f->callback)(f->environment, f->name, (fmi2Status)status, category, format);
}

static fmi2Status absent(fmi2Component c, const char *call, const char *why)
{
    return (fmi2Status)(c == NULL ? FMI_ERROR : fmi_fail(c, call, "%s", why));
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    return (fmi2Status)fmi_set_logging(c, __func__, loggingOn, nCategories, categories);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    fmi_request request = {.call = __func__,
                           .name = instanceName,
                           .token = fmuGUID,
                           .resources = fmuResourceLocation,
                           .logging_on = loggingOn,
                           .purpose = fmuType == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION,
                           .emit = emit,
                           .callback = functions != NULL ? (fmi_callback)functions->logger : NULL,
                           .environment = functions != NULL ? functions->componentEnvironment : NULL};
    (void)visible;
    return fmi_new(&request);
}

void fmi2FreeInstance(fmi2Component c) { fmi_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    return (fmi2Status)fmi_set_times(c, __func__, startTime, stopTimeDefined, stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (fmi2Status)fmi_enter_initialization(c, __func__); }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (fmi2Status)fmi_exit_initialization(c, __func__); }

fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)fmi_terminate(c, __func__); }

fmi2Status fmi2Reset(fmi2Component c) { return (fmi2Status)fmi_reset(c, __func__); }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    return (fmi2Status)fmi_get(c, __func__, GYRO_REAL, vr, nvr, value, nvr);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    return (fmi2Status)fmi_get(c, __func__, GYRO_INTEGER, vr, nvr, value, nvr);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    (void)value;
    return (fmi2Status)fmi_no_such_type(c, __func__, vr, nvr);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)value;
    return (fmi2Status)fmi_no_such_type(c, __func__, vr, nvr);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    return (fmi2Status)fmi_set(c, __func__, GYRO_REAL, vr, nvr, value, nvr);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    return (fmi2Status)fmi_set(c, __func__, GYRO_INTEGER, vr, nvr, value, nvr);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    (void)value;
    return (fmi2Status)fmi_no_such_type(c, __func__, vr, nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)value;
    return (fmi2Status)fmi_no_such_type(c, __func__, vr, nvr);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) { return (fmi2Status)fmi_save(c, __func__, FMUstate); }

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) { return (fmi2Status)fmi_restore(c, __func__, FMUstate); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) { return (fmi2Status)fmi_free_saved(c, __func__, FMUstate); }

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    return (fmi2Status)fmi_saved_size(c, __func__, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    return (fmi2Status)fmi_serialize(c, __func__, FMUstate, (unsigned char *)serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    return (fmi2Status)fmi_deserialize(c, __func__, (const unsigned char *)serializedState, size, FMUstate);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    const fmi_derivative of = {vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, nKnown, dvUnknown, nUnknown};
    return (fmi2Status)fmi_derive(c, __func__, &of);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return absent(c, __func__, "inputs are held over a step (canInterpolateInputs is false); set them before every step");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                        fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return absent(c, __func__, "outputs are samples without derivatives (maxOutputDerivativeOrder is 0)");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    return (fmi2Status)fmi_step(c, __func__, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component c) { return absent(c, __func__, "no step is pending: every step ends before fmi2DoStep returns"); }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    const fmi_instance *f = c;
    fmi_status status = fmi_allow(f, __func__, CAN_GET_STATUS);
    if (status == FMI_OK && (s != fmi2DoStepStatus || value == NULL)) {
        status = fmi_fail(f, __func__, "only fmi2DoStepStatus is a status, and it needs an address");
    } else if (status == FMI_OK) {
        *value = (fmi2Status)f->last_step;
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const fmi_instance *f = c;
    fmi_status status = fmi_allow(f, __func__, CAN_GET_STATUS);
    if (status == FMI_OK && (s != fmi2LastSuccessfulTime || value == NULL)) {
        status = fmi_fail(f, __func__, "only fmi2LastSuccessfulTime is real, and it needs an address");
    } else if (status == FMI_OK) {
        *value = gyro_time(f->core);
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s, (void)value;
    return absent(c, __func__, "no status of FMI 2 is an integer");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    const fmi_instance *f = c;
    fmi_status status = fmi_allow(f, __func__, CAN_GET_STATUS);
    if (status == FMI_OK && (s != fmi2Terminated || value == NULL)) {
        status = fmi_fail(f, __func__, "only fmi2Terminated is Boolean, and it needs an address");
    } else if (status == FMI_OK) {
        *value = fmi2False; /* the device never asks for the end of a simulation */
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)s, (void)value;
    return absent(c, __func__, "no step is pending: every step ends before fmi2DoStep returns");
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { return (fmi2Status)fmi_enter_event_mode(c, __func__); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo)
{
    int jumped = 0;
    double next = 0.0;
    fmi_status status = FMI_ERROR;
    if (fmi2eventInfo == NULL) {
        return absent(c, __func__, "the address for the event info is NULL");
    }
    status = fmi_update(c, __func__, &jumped, &next);
    if (status == FMI_OK) {
        *fmi2eventInfo = (fmi2EventInfo){.valuesOfContinuousStatesChanged = jumped, .nextEventTimeDefined = fmi2True, .nextEventTime = next};
    }
    return (fmi2Status)status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return (fmi2Status)fmi_leave_event_mode(c, __func__, CONTINUOUS); }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint, fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation)
{
    const fmi_status status = fmi_completed_step(c, __func__);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (status == FMI_OK && enterEventMode != NULL && terminateSimulation != NULL) {
        *enterEventMode = fmi2False;
        *terminateSimulation = fmi2False;
    }
    return (fmi2Status)status;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return (fmi2Status)fmi_set_time(c, __func__, time); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) { return (fmi2Status)fmi_set_states(c, __func__, x, nx); }

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    return (fmi2Status)fmi_get_rates(c, __func__, derivatives, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    (void)eventIndicators;
    return (fmi2Status)fmi_no_indicators(c, __func__, ni);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) { return (fmi2Status)fmi_get_states(c, __func__, x, nx); }

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    return (fmi2Status)fmi_get_nominals(c, __func__, x_nominal, nx);
}
