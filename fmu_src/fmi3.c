/* FMI 3.0: every function of fmi3Functions.h, over fmi_common.h.

   What this FMU lacks (input clocks, structural parameters, scheduled execution) is an error with a message, as modelDescription.xml announces. */

#include <fmi3Functions.h>

#include "continuous.h"
#include "fmi_common.h"

#include <math.h>

#define NO_SCHEDULE "this FMU has no model partitions to schedule (ScheduledExecution is absent)"
#define NO_CONFIGURATION "this FMU has no structural parameters, so no configuration mode"
#define NO_INTERVALS "this FMU has no clock with an interval, and none that an importer sets"
#define NO_DEPENDENCIES "this FMU gives no dependencies at run time; they are in modelDescription.xml"
#define NO_DERIVATIVES "this FMU gives no derivatives of outputs by time"

static void emit(const fmi_instance *f, fmi_status status, const char *category, const char *text)
{
    ((fmi3LogMessageCallback)f->callback)(f->environment, (fmi3Status)status, category, text);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[])
{
    return (fmi3Status)fmi_set_logging(instance, __func__, loggingOn, nCategories, categories);
}

static double update_intermediate(fmi_instance *f)
{
    fmi3Boolean end_requested = fmi3False;
    fmi3Float64 end = 0.0;
    ((fmi3IntermediateUpdateCallback)f->update)(f->environment, gyro_time(f->core), fmi3False, fmi3True, fmi3True, f->may_end_early != 0,
                                                &end_requested, &end);
    return end_requested && f->may_end_early ? end : INFINITY;
}

static fmi3Instance instantiate(const char *call, fmi_purpose purpose, const char *refusal, fmi3String name, fmi3String token, fmi3String resources,
                                fmi3Boolean logging_on, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3Boolean may_end_early,
                                fmi3IntermediateUpdateCallback update)
{
    fmi_request request = {.call = call,
                           .name = name,
                           .token = token,
                           .resources = resources,
                           .refusal = refusal,
                           .logging_on = logging_on,
                           .purpose = purpose,
                           .emit = emit,
                           .callback = (fmi_callback)log,
                           .environment = environment,
                           .watch = update_intermediate,
                           .update = (fmi_callback)update,
                           .may_end_early = may_end_early};
    return fmi_new(&request);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                                          fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    const char *none = GYRO_N_CLOCKS > 0 ? "an FMU with clocks is for co-simulation only" : NULL;
    (void)visible;
    return instantiate(__func__, MODEL_EXCHANGE, none, instanceName, instantiationToken, resourcePath, loggingOn, instanceEnvironment, logMessage, fmi3False,
                       NULL);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                                         fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                                         fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const fmi_purpose purpose = eventModeUsed ? CO_SIMULATION_WITH_EVENTS : CO_SIMULATION;
    const char *none = eventModeUsed && gyro_no_equation() != NULL
                           ? "this FMU has no event mode (hasEventMode is false); pass eventModeUsed = false"
                           : NULL;
    /* All variables can be read at an intermediate point, whichever are asked for. */
    (void)visible, (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
    return instantiate(__func__, purpose, none, instanceName, instantiationToken, resourcePath, loggingOn, instanceEnvironment, logMessage,
                       earlyReturnAllowed, intermediateUpdate);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                                               fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)visible, (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    return instantiate(__func__, CO_SIMULATION, NO_SCHEDULE, instanceName, instantiationToken, resourcePath, loggingOn, instanceEnvironment, logMessage, fmi3False,
                       NULL);
}

void fmi3FreeInstance(fmi3Instance instance) { fmi_free(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    fmi_status status = fmi_set_times(instance, __func__, startTime, stopTimeDefined, stopTime);
    (void)toleranceDefined, (void)tolerance;
    if (status == FMI_OK) {
        status = fmi_enter_initialization(instance, __func__);
    }
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return (fmi3Status)fmi_exit_initialization(instance, __func__); }

fmi3Status fmi3Terminate(fmi3Instance instance) { return (fmi3Status)fmi_terminate(instance, __func__); }

fmi3Status fmi3Reset(fmi3Instance instance) { return (fmi3Status)fmi_reset(instance, __func__); }

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 values[],
                          size_t nValues)
{
    return (fmi3Status)fmi_get(instance, __func__, GYRO_REAL, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    return (fmi3Status)fmi_set(instance, __func__, GYRO_REAL, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Int32 values[],
                        size_t nValues)
{
    return (fmi3Status)fmi_get(instance, __func__, GYRO_INTEGER, valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int32 values[], size_t nValues)
{
    return (fmi3Status)fmi_set(instance, __func__, GYRO_INTEGER, valueReferences, nValueReferences, values, nValues);
}

static fmi3Status absent(fmi3Instance instance, const char *call, const char *why)
{
    return (fmi3Status)(instance == NULL ? FMI_ERROR : fmi_fail(instance, call, "%s", why));
}

/* fmi3GetT and fmi3SetT of a type T that no variable has. */
#define NO_VARIABLE_OF(T)                                                                                            \
    fmi3Status fmi3Get##T(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
                          fmi3##T values[], size_t nValues)                                                          \
    {                                                                                                                \
        (void)values, (void)nValues;                                                                                 \
        return (fmi3Status)fmi_no_such_type(instance, __func__, valueReferences, nValueReferences);                  \
    }                                                                                                                \
    fmi3Status fmi3Set##T(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
                          const fmi3##T values[], size_t nValues)                                                    \
    {                                                                                                                \
        (void)values, (void)nValues;                                                                                 \
        return (fmi3Status)fmi_no_such_type(instance, __func__, valueReferences, nValueReferences);                  \
    }

NO_VARIABLE_OF(Float32)
NO_VARIABLE_OF(Int8)
NO_VARIABLE_OF(UInt8)
NO_VARIABLE_OF(Int16)
NO_VARIABLE_OF(UInt16)
NO_VARIABLE_OF(UInt32)
NO_VARIABLE_OF(Int64)
NO_VARIABLE_OF(UInt64)
NO_VARIABLE_OF(Boolean)
NO_VARIABLE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, size_t valueSizes[],
                         fmi3Binary values[], size_t nValues)
{
    (void)valueSizes, (void)values, (void)nValues;
    return (fmi3Status)fmi_no_such_type(instance, __func__, valueReferences, nValueReferences);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueSizes, (void)values, (void)nValues;
    return (fmi3Status)fmi_no_such_type(instance, __func__, valueReferences, nValueReferences);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Clock values[])
{
    return (fmi3Status)fmi_get_clocks(instance, __func__, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    (void)valueReferences, (void)values;
    return nValueReferences == 0 && instance != NULL ? fmi3OK : absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) { return (fmi3Status)fmi_save(instance, __func__, FMUState); }

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) { return (fmi3Status)fmi_restore(instance, __func__, FMUState); }

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    return (fmi3Status)fmi_free_saved(instance, __func__, FMUState);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    return (fmi3Status)fmi_saved_size(instance, __func__, FMUState, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    return (fmi3Status)fmi_serialize(instance, __func__, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
{
    return (fmi3Status)fmi_deserialize(instance, __func__, serializedState, size, FMUState);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    fmi_instance *f = instance;
    fmi_status status = FMI_OK;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (f == NULL) {
        status = FMI_ERROR;
    } else if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL || lastSuccessfulTime == NULL) {
        status = fmi_fail(f, __func__, "an address for a result is NULL; pass all four");
    } else {
        status = fmi_step(f, __func__, currentCommunicationPoint, communicationStepSize);
        *eventHandlingNeeded = status != FMI_ERROR && f->purpose == CO_SIMULATION_WITH_EVENTS && f->sampled;
        *terminateSimulation = fmi3False;
        *earlyReturn = status == FMI_DISCARD && f->may_end_early;
        status = *earlyReturn ? FMI_OK : status;
        *lastSuccessfulTime = gyro_time(f->core);
    }
    return (fmi3Status)status;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    return (fmi3Status)fmi_enter_event_mode(instance, __func__);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return (fmi3Status)fmi_leave_event_mode(instance, __func__, STEPPING);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return absent(instance, __func__, "nothing is evaluated apart (providesEvaluateDiscreteStates is false); call fmi3UpdateDiscreteStates");
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    fmi_instance *f = instance;
    int jumped = 0;
    double next = 0.0;
    fmi_status status = FMI_ERROR;
    if (discreteStatesNeedUpdate == NULL || terminateSimulation == NULL || nominalsOfContinuousStatesChanged == NULL ||
        valuesOfContinuousStatesChanged == NULL || nextEventTimeDefined == NULL || nextEventTime == NULL) {
        return absent(instance, __func__, "an address for a result is NULL; pass all six");
    }
    status = fmi_update(f, __func__, &jumped, &next);
    if (status == FMI_OK) {
        *discreteStatesNeedUpdate = fmi3False;
        *terminateSimulation = fmi3False;
        *nominalsOfContinuousStatesChanged = fmi3False;
        *valuesOfContinuousStatesChanged = jumped != 0;
        *nextEventTimeDefined = fmi3True;
        *nextEventTime = next;
    }
    return (fmi3Status)status;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) { return absent(instance, __func__, NO_CONFIGURATION); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) { return absent(instance, __func__, NO_CONFIGURATION); }

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences, (void)nValueReferences, (void)intervals, (void)qualifiers;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions, (void)qualifiers;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                               fmi3Float64 shifts[])
{
    (void)valueReferences, (void)nValueReferences, (void)shifts;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                  const fmi3Float64 intervals[])
{
    (void)valueReferences, (void)nValueReferences, (void)intervals;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                               const fmi3Float64 shifts[])
{
    (void)valueReferences, (void)nValueReferences, (void)shifts;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
{
    (void)clockReference, (void)activationTime;
    return absent(instance, __func__, NO_INTERVALS);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies)
{
    (void)valueReference, (void)nDependencies;
    return absent(instance, __func__, NO_DEPENDENCIES);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents, (void)dependencyKinds,
    (void)nDependencies;
    return absent(instance, __func__, NO_DEPENDENCIES);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity)
{
    const fmi_derivative of = {unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity};
    return (fmi3Status)fmi_derive(instance, __func__, &of);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity)
{
    const fmi_derivative of = {unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity};
    return (fmi3Status)fmi_derive_adjoint(instance, __func__, &of);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    (void)valueReferences, (void)nValueReferences, (void)orders, (void)values, (void)nValues;
    return absent(instance, __func__, NO_DERIVATIVES);
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    return (fmi3Status)fmi_leave_event_mode(instance, __func__, CONTINUOUS);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation)
{
    const fmi_status status = fmi_completed_step(instance, __func__);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (status == FMI_OK && enterEventMode != NULL && terminateSimulation != NULL) {
        *enterEventMode = fmi3False;
        *terminateSimulation = fmi3False;
    }
    return (fmi3Status)status;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    return (fmi3Status)fmi_set_time(instance, __func__, time);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    return (fmi3Status)fmi_set_states(instance, __func__, continuousStates, nContinuousStates);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates)
{
    return (fmi3Status)fmi_get_rates(instance, __func__, derivatives, nContinuousStates);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators)
{
    (void)eventIndicators;
    return (fmi3Status)fmi_no_indicators(instance, __func__, nEventIndicators);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    return (fmi3Status)fmi_get_states(instance, __func__, continuousStates, nContinuousStates);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates)
{
    return (fmi3Status)fmi_get_nominals(instance, __func__, nominals, nContinuousStates);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators)
{
    const fmi_status status = fmi_allow_exchange(instance, __func__, ANY_STATE);
    if (status == FMI_OK && nEventIndicators != NULL) {
        *nEventIndicators = 0;
    }
    return (fmi3Status)status;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates)
{
    const fmi_status status = fmi_allow_exchange(instance, __func__, ANY_STATE);
    if (status == FMI_OK && nContinuousStates != NULL) {
        *nContinuousStates = GYRO_N_CONTINUOUS;
    }
    return (fmi3Status)status;
}
