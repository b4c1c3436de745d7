/* y[i] = 2 u[i] for any number of inputs and outputs: value references 2 i and 2 i + 1 (FMI 2.0, Co-Simulation).
   An output shows the input of the last step. */

#include <stdlib.h>

#include "fmi2FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define SIZE 200000

static double *values(void *p) { return p; }

EXPORT void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                             const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    return calloc(SIZE, sizeof(double));
}
EXPORT void fmi2FreeInstance(void *p) { free(p); }
EXPORT fmi2Status fmi2GetReal(void *p, const unsigned vr[], size_t n, double out[]) {
    for (size_t i = 0; i < n; i++) out[i] = values(p)[vr[i]];
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetReal(void *p, const unsigned vr[], size_t n, const double in[]) {
    for (size_t i = 0; i < n; i++) values(p)[vr[i]] = in[i];
    return fmi2OK;
}
EXPORT fmi2Status fmi2DoStep(void *p, double t, double h, fmi2Boolean no_restore) {
    for (int i = 0; i < SIZE; i += 2) values(p)[i + 1] = 2 * values(p)[i];
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetupExperiment(void *p, fmi2Boolean has_tolerance, double tolerance, double start,
                                      fmi2Boolean has_stop, double stop) {
    return fmi2OK;
}

#define SAME(name) EXPORT fmi2Status name(void *p) { return fmi2OK; }
SAME(fmi2EnterInitializationMode) SAME(fmi2ExitInitializationMode) SAME(fmi2Terminate) SAME(fmi2Reset)
