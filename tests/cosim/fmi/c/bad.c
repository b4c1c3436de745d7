/* x' = u - x, v = x + 2 u (FMI 2.0, both interfaces), with the fault that its GUID names; "good" has none.

   The step is exact for a held input, so it does not depend on the step size. */

#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define HAS(name) (strcmp(p->fault, name) == 0)
#define CRASH (*(volatile int *)0 = 1)

enum { U = 1, X, DER_X, V };

struct model {
    char fault[32];
    double u, x, t;
    int ready, gets;
};
#define P struct model *p

static char *volatile lost; /* so that the compiler keeps the allocation */
static double shared; /* the state that all instances share with the fault "shared" */

EXPORT void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                             const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    struct model *p = calloc(1, sizeof *p);
    strncpy(p->fault, guid, sizeof p->fault - 1);
    p->x = 0.5;
    if (HAS("crash at instantiate")) CRASH;
    if (HAS("no instance")) return NULL;
    if (HAS("leak")) memset(lost = malloc(20000), 1, 20000);
    if (HAS("leak much")) memset(lost = malloc(500000), 1, 500000);
    if (HAS("leak handles") && open("/dev/null", O_RDONLY) < 0) return NULL;
    return p;
}
EXPORT void fmi2FreeInstance(P) {
    if (HAS("crash at free")) CRASH;
    free(p);
}

EXPORT fmi2Status fmi2SetupExperiment(P, fmi2Boolean has_tolerance, double tolerance, double start,
                                      fmi2Boolean has_stop, double stop) {
    p->t = start;
    return fmi2OK;
}
EXPORT fmi2Status fmi2EnterInitializationMode(P) {
    if (HAS("shared")) shared = 0.5;
    return HAS("no initialization") ? fmi2Error : fmi2OK;
}
EXPORT fmi2Status fmi2ExitInitializationMode(P) {
    p->ready = 1;
    return fmi2OK;
}
EXPORT fmi2Status fmi2Terminate(P) {
    while (HAS("hang at terminate")) sleep(1);
    return fmi2OK;
}
EXPORT fmi2Status fmi2Reset(P) {
    if (HAS("crash at reset")) CRASH;
    if (!HAS("reset keeps x")) p->x = 0.5;
    if (!HAS("reset keeps u")) p->u = 0;
    p->ready = 0;
    return fmi2OK;
}

/* --- values */

static double get(P, unsigned vr) {
    double x = HAS("shared") ? shared : p->x;
    switch (vr) {
    case U: return p->u;
    case X:
        if (HAS("not finite")) return NAN;
        if (HAS("undeclared")) return x + p->u;
        if (HAS("get counts")) return x + p->gets++;
        return x;
    case DER_X: return HAS("derivative not finite") ? INFINITY : p->u - x;
    default: return HAS("not seen") ? x : x + 2 * p->u;
    }
}
EXPORT fmi2Status fmi2GetReal(P, const unsigned vr[], size_t n, double values[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > V && HAS("crash at reference")) CRASH;
        if ((vr[i] < U || vr[i] > V) && !HAS("silent")) return fmi2Error;
        values[i] = get(p, vr[i]);
    }
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetReal(P, const unsigned vr[], size_t n, const double values[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != U) return fmi2Error;
        p->u = values[i];
    }
    return fmi2OK;
}

/* --- state */

EXPORT fmi2Status fmi2GetFMUstate(P, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof *p);
    memcpy(*state, p, sizeof *p);
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetFMUstate(P, fmi2FMUstate state) {
    if (HAS("crash at state")) CRASH;
    double x = p->x;
    memcpy(p, state, sizeof *p);
    if (HAS("state without x")) p->x = x;
    return fmi2OK;
}
EXPORT fmi2Status fmi2FreeFMUstate(P, fmi2FMUstate *state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializedFMUstateSize(P, fmi2FMUstate state, size_t *size) {
    *size = sizeof *p;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializeFMUstate(P, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    memcpy(bytes, state, sizeof *p);
    if (HAS("bytes without x")) ((struct model *)bytes)->x = 0;
    return fmi2OK;
}
EXPORT fmi2Status fmi2DeSerializeFMUstate(P, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    *state = malloc(sizeof *p);
    memcpy(*state, bytes, sizeof *p);
    return fmi2OK;
}

/* --- Co-Simulation */

EXPORT fmi2Status fmi2DoStep(P, double t, double h, fmi2Boolean no_restore) {
    if (HAS("exit at step")) exit(0);
    while (HAS("hang at step")) sleep(1);
    if ((!p->ready || h <= 0.0) && !HAS("silent")) return fmi2Error;
    if (HAS("steps of 0.25") && h != 0.25) return fmi2Discard;
    double *x = HAS("shared") ? &shared : &p->x;
    *x += (p->u - *x) * (HAS("euler") ? h : -expm1(-h));
    if (HAS("extra per step")) *x += 0.1;
    if (HAS("differs at random")) *x += rand() * 1e-12;
    return fmi2OK;
}

/* --- Model Exchange */

#define SAME(name) EXPORT fmi2Status name(P) { return fmi2OK; }
SAME(fmi2EnterEventMode) SAME(fmi2EnterContinuousTimeMode)

EXPORT fmi2Status fmi2NewDiscreteStates(P, fmi2EventInfo *info) {
    memset(info, 0, sizeof *info);
    info->newDiscreteStatesNeeded = HAS("endless event");
    return fmi2OK;
}
EXPORT fmi2Status fmi2CompletedIntegratorStep(P, fmi2Boolean no_restore, fmi2Boolean *event, fmi2Boolean *end) {
    *event = *end = fmi2False;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetTime(P, double t) {
    p->t = t;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetContinuousStates(P, const double x[], size_t n) {
    *(HAS("shared") ? &shared : &p->x) = x[0];
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetContinuousStates(P, double x[], size_t n) {
    x[0] = HAS("shared") ? shared : p->x;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetDerivatives(P, double d[], size_t n) {
    d[0] = get(p, DER_X);
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetEventIndicators(P, double z[], size_t n) {
    z[0] = HAS("indicator not finite") ? NAN : 2.0 - p->x;
    return fmi2OK;
}
