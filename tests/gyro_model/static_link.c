/* Starts and steps one FMU that is linked into this program under its prefix: compiled once for each FMU with STEPPED the name of this
   function, and FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX. The outputs of value references 0 .. n - 1 must be numbers after the step. */

#if defined(FMI2_FUNCTION_PREFIX)
#include <fmi2Functions.h>

int STEPPED(const char *token, double values[], size_t n);

static void ignore(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status, (void)category, (void)text;
}

int STEPPED(const char *token, double values[], size_t n)
{
    const fmi2CallbackFunctions callbacks = {ignore, NULL, NULL, NULL, NULL};
    fmi2Component c = fmi2Instantiate("one", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    int ok = c != NULL && fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK && fmi2EnterInitializationMode(c) == fmi2OK &&
             fmi2ExitInitializationMode(c) == fmi2OK && fmi2DoStep(c, 0.0, 1e-3, fmi2True) == fmi2OK;
    for (unsigned i = 0; ok && i < n; i++) {
        ok = fmi2GetReal(c, &i, 1, &values[i]) == fmi2OK;
    }
    fmi2FreeInstance(c);
    return ok;
}
#else
#include <fmi3Functions.h>

int STEPPED(const char *token, double values[], size_t n);

int STEPPED(const char *token, double values[], size_t n)
{
    fmi3Instance c = fmi3InstantiateCoSimulation("one", token, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    bool event, terminate, early;
    double reached;
    int ok = c != NULL && fmi3EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0) == fmi3OK && fmi3ExitInitializationMode(c) == fmi3OK &&
             fmi3DoStep(c, 0.0, 1e-3, true, &event, &terminate, &early, &reached) == fmi3OK;
    for (unsigned i = 0; ok && i < n; i++) {
        ok = fmi3GetFloat64(c, &i, 1, &values[i], 1) == fmi3OK;
    }
    fmi3FreeInstance(c);
    return ok;
}
#endif
