/* The model of probe.h as an FMI 2.0 FMU, Co-Simulation and Model Exchange. */

#include "probe.h"

#include "fmi2FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define P struct probe *p

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                             const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    return probe_new();
}
EXPORT void fmi2FreeInstance(P) { free(p); }

#define SAME(name) EXPORT fmi2Status name(P) { return fmi2OK; }
SAME(fmi2Reset) SAME(fmi2Terminate) SAME(fmi2EnterInitializationMode) SAME(fmi2ExitInitializationMode)
SAME(fmi2SetDebugLogging) SAME(fmi2CancelStep)

#define NOT_THERE(name) EXPORT fmi2Status name(P) { return fmi2Error; }
NOT_THERE(fmi2GetFMUstate) NOT_THERE(fmi2SetFMUstate) NOT_THERE(fmi2FreeFMUstate)
NOT_THERE(fmi2SerializedFMUstateSize) NOT_THERE(fmi2SerializeFMUstate) NOT_THERE(fmi2DeSerializeFMUstate)
NOT_THERE(fmi2GetDirectionalDerivative) NOT_THERE(fmi2SetRealInputDerivatives)
NOT_THERE(fmi2GetRealOutputDerivatives) NOT_THERE(fmi2GetStatus) NOT_THERE(fmi2GetIntegerStatus)
NOT_THERE(fmi2GetStringStatus) NOT_THERE(fmi2GetNominalsOfContinuousStates)

EXPORT fmi2Status fmi2SetupExperiment(P, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean has_stop, fmi2Real stop) {
    p->time = start;
    return fmi2OK;
}

#define VALUES(name, type)                                                                                   \
    EXPORT fmi2Status fmi2Get##name(P, const unsigned vr[], size_t n, type values[]) {                       \
        for (size_t i = 0; i < n; i++) values[i] = (type)probe_get(p, vr[i]);                                \
        return fmi2OK;                                                                                       \
    }                                                                                                        \
    EXPORT fmi2Status fmi2Set##name(P, const unsigned vr[], size_t n, const type values[]) {                 \
        for (size_t i = 0; i < n; i++) {                                                                     \
            if (p->continuous_time && vr[i] != R_IN) return fmi2Error;                                       \
            p->in[vr[i]] = values[i];                                                                        \
        }                                                                                                    \
        return fmi2OK;                                                                                       \
    }
VALUES(Real, double)
VALUES(Integer, int)
VALUES(Boolean, int)

EXPORT fmi2Status fmi2SetString(P, const unsigned vr[], size_t n, const fmi2String values[]) {
    if (n == 1 && vr[0] == TEXT_IN && !p->continuous_time && strlen(values[0]) < sizeof p->text)
        return strcpy(p->text, values[0]), fmi2OK;
    if (n != 1 || vr[0] != LABEL) return fmi2Error;
    p->label_length = (int)strlen(values[0]);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetString(P, const unsigned vr[], size_t n, fmi2String values[]) {
    if (n != 1 || (vr[0] != TEXT_IN && vr[0] != TEXT_OUT)) return fmi2Error;
    values[0] = p->text;
    return fmi2OK;
}

/* --- Co-Simulation */

EXPORT fmi2Status fmi2DoStep(P, double t, double h, fmi2Boolean no_restore) {
    p->terminated = t + h >= p->in[END_AT];
    p->time = t + h > p->in[EARLY_AT] ? (double)p->in[EARLY_AT] : t + h;
    p->x += p->time - t;
    probe_event(p);
    return p->terminated || p->time < t + h ? fmi2Discard : fmi2OK;
}
EXPORT fmi2Status fmi2GetRealStatus(P, fmi2StatusKind kind, double *value) {
    *value = p->time;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetBooleanStatus(P, fmi2StatusKind kind, fmi2Boolean *value) {
    *value = p->terminated;
    return fmi2OK;
}

/* --- Model Exchange */

EXPORT fmi2Status fmi2EnterEventMode(P) {
    p->continuous_time = false;
    return fmi2OK;
}
EXPORT fmi2Status fmi2EnterContinuousTimeMode(P) {
    p->continuous_time = true;
    return fmi2OK;
}

EXPORT fmi2Status fmi2NewDiscreteStates(P, fmi2EventInfo *info) {
    probe_event(p);
    memset(info, 0, sizeof *info);
    info->valuesOfContinuousStatesChanged = info->nextEventTimeDefined = fmi2True;
    info->nextEventTime = p->next;
    return fmi2OK;
}
EXPORT fmi2Status fmi2CompletedIntegratorStep(P, fmi2Boolean no_restore, fmi2Boolean *event, fmi2Boolean *end) {
    probe_completed(p);
    *event = p->step_event;
    *end = p->time >= p->in[END_AT];
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetTime(P, double t) {
    p->time = t;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetContinuousStates(P, const double x[], size_t n) {
    p->x = x[0];
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetContinuousStates(P, double x[], size_t n) {
    x[0] = p->x;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetDerivatives(P, double d[], size_t n) {
    d[0] = 1.0;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetEventIndicators(P, double z[], size_t n) {
    z[0] = 1.0 - p->x;
    return fmi2OK;
}
