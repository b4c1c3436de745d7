/* The model of probe.h as an FMI 3.0 FMU, Co-Simulation and Model Exchange. */

#include "probe.h"

#include "fmi3FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define P struct probe *p

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateModelExchange(void) { return probe_new(); }
EXPORT void *fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                         bool logging, bool event_mode, bool early_return) {
    return event_mode ? NULL : probe_new();
}
EXPORT void fmi3FreeInstance(P) { free(p); }

#define SAME(name) EXPORT fmi3Status name(P) { return fmi3OK; }
SAME(fmi3Reset) SAME(fmi3Terminate) SAME(fmi3ExitInitializationMode)
SAME(fmi3SetDebugLogging) SAME(fmi3EnterConfigurationMode)
SAME(fmi3ExitConfigurationMode) SAME(fmi3EvaluateDiscreteStates)

EXPORT fmi3Status fmi3EnterInitializationMode(P, bool has_tolerance, double tolerance, double start, bool has_stop,
                                              double stop) {
    p->time = start;
    return fmi3OK;
}

/* All arrays are Float64. The number of values must be that of the elements, or it is an error. */
static fmi3Status arrays(struct probe *p, const unsigned vr[], size_t n, size_t n_values) {
    size_t elements = 0;
    for (size_t i = 0; i < n; i++) elements += vr[i] == V_IN || vr[i] == V_OUT ? (size_t)p->n : 1;
    return elements == n_values ? fmi3OK : fmi3Error;
}

#define VALUES(name, type)                                                                                   \
    EXPORT fmi3Status fmi3Get##name(P, const unsigned vr[], size_t n, type values[], size_t n_values) {      \
        for (size_t i = 0; i < n; i++) {                                                                     \
            if (vr[i] == V_IN)                                                                               \
                for (int j = 0; j < p->n; j++) *values++ = (type)p->v[j];                                    \
            else if (vr[i] == V_OUT)                                                                         \
                for (int j = p->n; j-- > 0;) *values++ = (type)(2.0 * p->v[j]);                              \
            else                                                                                             \
                *values++ = (type)probe_get(p, vr[i]);                                                       \
        }                                                                                                    \
        return arrays(p, vr, n, n_values);                                                                   \
    }                                                                                                        \
    EXPORT fmi3Status fmi3Set##name(P, const unsigned vr[], size_t n, const type values[], size_t n_values) {\
        if (arrays(p, vr, n, n_values)) return fmi3Error;                                                    \
        for (size_t i = 0; i < n; i++) {                                                                     \
            if (p->continuous_time && vr[i] != R_IN && vr[i] != F32_IN && vr[i] != V_IN) return fmi3Error;   \
            if (vr[i] == V_IN)                                                                               \
                for (int j = 0; j < p->n; j++) p->v[j] = (double)*values++;                                  \
            else if (vr[i] == N)                                                                             \
                p->n = (int)*values++;                                                                       \
            else                                                                                             \
                p->in[vr[i]] = *values++;                                                                    \
        }                                                                                                    \
        return fmi3OK;                                                                                       \
    }
VALUES(Float64, double)
VALUES(Float32, float)
VALUES(Int8, int8_t)
VALUES(UInt8, uint8_t)
VALUES(Int16, int16_t)
VALUES(UInt16, uint16_t)
VALUES(Int32, int32_t)
VALUES(UInt32, uint32_t)
VALUES(Int64, int64_t)
VALUES(UInt64, uint64_t)
VALUES(Boolean, bool)

EXPORT fmi3Status fmi3SetString(P, const unsigned vr[], size_t n, const fmi3String values[], size_t n_values) {
    if (n == 1 && vr[0] == TEXT_IN && !p->continuous_time && strlen(values[0]) < sizeof p->text)
        return strcpy(p->text, values[0]), fmi3OK;
    if (n != 1 || vr[0] != LABEL) return fmi3Error;
    p->label_length = (int)strlen(values[0]);
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetBinary(P, const unsigned vr[], size_t n, const size_t sizes[], const fmi3Binary values[],
                                size_t n_values) {
    if (n != 1 || vr[0] != BLOB) return fmi3Error;
    p->blob_sum = 0;
    for (size_t i = 0; i < sizes[0]; i++) p->blob_sum += values[0][i];
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetString(P, const unsigned vr[], size_t n, fmi3String values[], size_t n_values) {
    if (n != 1 || (vr[0] != TEXT_IN && vr[0] != TEXT_OUT)) return fmi3Error;
    values[0] = p->text;
    return fmi3OK;
}

/* --- Co-Simulation */

EXPORT fmi3Status fmi3DoStep(P, double t, double h, bool no_restore, bool *event, bool *terminate, bool *early,
                             double *last) {
    *event = false;
    *terminate = t + h >= p->in[END_AT];
    *early = t < p->in[EARLY_AT] && p->in[EARLY_AT] < t + h;
    *last = p->time = *early ? (double)p->in[EARLY_AT] : t + h;
    p->x += p->time - t;
    probe_event(p);
    return fmi3OK;
}

/* --- Model Exchange */

EXPORT fmi3Status fmi3EnterEventMode(P) {
    p->continuous_time = false;
    return fmi3OK;
}
EXPORT fmi3Status fmi3EnterContinuousTimeMode(P) {
    p->continuous_time = true;
    return fmi3OK;
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(P, bool *again, bool *end, bool *nominals, bool *states, bool *timed,
                                           double *next) {
    probe_event(p);
    *again = *end = *nominals = false;
    *states = *timed = true;
    *next = p->next;
    return fmi3OK;
}
EXPORT fmi3Status fmi3CompletedIntegratorStep(P, bool no_restore, bool *event, bool *end) {
    probe_completed(p);
    *event = p->step_event;
    *end = p->time >= p->in[END_AT];
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetTime(P, double t) {
    p->time = t;
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetContinuousStates(P, const double x[], size_t n) {
    p->x = x[0];
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetContinuousStates(P, double x[], size_t n) {
    x[0] = p->x;
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetContinuousStateDerivatives(P, double d[], size_t n) {
    d[0] = 1.0;
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetEventIndicators(P, double z[], size_t n) {
    z[0] = 1.0 - p->x;
    return fmi3OK;
}
#define COUNT(name)                                                                                          \
    EXPORT fmi3Status name(P, size_t *n) {                                                                   \
        *n = 1;                                                                                              \
        return fmi3OK;                                                                                       \
    }
COUNT(fmi3GetNumberOfContinuousStates)
COUNT(fmi3GetNumberOfEventIndicators)
