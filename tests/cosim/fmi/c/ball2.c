/* A model with events, as an FMI 2.0 FMU for Model Exchange.

     h' = v, v' = -g + gust        a ball; where h <= 0 it bounces: h = 0, v = -e v, and rests below v = 0.02
     q' = level                    level = 1 until the time event at first_at, then -1, 1, -1, ... every period
     gusts                         counts how often the input gust passed 0.5, upwards

   The simulation is asked to end at bounce number end_at_bounce. Derivatives are discarded for h < -hole
   (fmi2Discard), and fail for v < -fails_at. */

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { H, V, Q, STATES };
enum { GUST = 6, GRAVITY, E, FIRST, PERIOD, END_AT, HOLE, FAILS_AT, BOUNCES, GUSTS, LEVEL, VALUES };

struct ball {
    double x[VALUES]; /* by value reference; 3, 4 and 5 are the derivatives */
    double time, next;
    bool resting, blowing, terminate;
};
#define P struct ball *p
#define EXPORT __attribute__((visibility("default")))

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                             const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    P = calloc(1, sizeof *p);
    p->x[H] = p->x[GRAVITY] = p->x[LEVEL] = 1; /* as in modelDescription.xml */
    p->x[E] = 0.5;
    p->x[FIRST] = p->x[PERIOD] = p->x[HOLE] = p->x[FAILS_AT] = p->x[END_AT] = 1e9;
    return p;
}
EXPORT void fmi2FreeInstance(P) { free(p); }

#define SAME(name) EXPORT fmi2Status name(P) { return fmi2OK; }
SAME(fmi2Reset) SAME(fmi2Terminate) SAME(fmi2EnterInitializationMode) SAME(fmi2SetDebugLogging)
SAME(fmi2EnterEventMode) SAME(fmi2EnterContinuousTimeMode)

#define NOT_THERE(name) EXPORT fmi2Status name(P) { return fmi2Error; }
NOT_THERE(fmi2GetString) NOT_THERE(fmi2SetString) NOT_THERE(fmi2GetInteger) NOT_THERE(fmi2SetInteger)
NOT_THERE(fmi2GetBoolean) NOT_THERE(fmi2SetBoolean) NOT_THERE(fmi2SerializedFMUstateSize)
NOT_THERE(fmi2SerializeFMUstate) NOT_THERE(fmi2DeSerializeFMUstate) NOT_THERE(fmi2GetDirectionalDerivative)

EXPORT fmi2Status fmi2GetFMUstate(P, void **state) {
    if (!*state) *state = malloc(sizeof *p);
    memcpy(*state, p, sizeof *p);
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetFMUstate(P, void *state) {
    memcpy(p, state, sizeof *p);
    return fmi2OK;
}
EXPORT fmi2Status fmi2FreeFMUstate(P, void **state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(P, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean has_stop, fmi2Real stop) {
    p->time = start;
    return fmi2OK;
}
EXPORT fmi2Status fmi2ExitInitializationMode(P) {
    p->next = p->x[FIRST];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDerivatives(P, double d[], size_t n) {
    if (p->x[H] < -p->x[HOLE]) return fmi2Discard;
    if (p->x[V] < -p->x[FAILS_AT]) return fmi2Error;
    d[0] = p->x[V];
    d[1] = p->resting ? 0 : p->x[GUST] - p->x[GRAVITY];
    d[2] = p->x[LEVEL];
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetReal(P, const unsigned vr[], size_t n, double values[]) {
    fmi2GetDerivatives(p, p->x + STATES, STATES);
    for (size_t i = 0; i < n; i++) values[i] = p->x[vr[i]];
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetReal(P, const unsigned vr[], size_t n, const double values[]) {
    for (size_t i = 0; i < n; i++) p->x[vr[i]] = values[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2NewDiscreteStates(P, fmi2EventInfo *info) {
    if (p->x[H] <= 0 && p->x[V] < 0) {
        p->x[H] = 0;
        p->x[V] *= -p->x[E];
        if (p->x[V] < 0.02) p->resting = true, p->x[V] = 0;
        p->terminate = ++p->x[BOUNCES] >= p->x[END_AT];
    }
    for (; p->time >= p->next; p->next += p->x[PERIOD]) p->x[LEVEL] *= -1;
    bool blowing = p->x[GUST] > 0.5;
    p->x[GUSTS] += blowing && !p->blowing;
    p->blowing = blowing;
    memset(info, 0, sizeof *info);
    info->valuesOfContinuousStatesChanged = info->nextEventTimeDefined = fmi2True;
    info->nextEventTime = p->next;
    info->terminateSimulation = p->terminate;
    return fmi2OK;
}
EXPORT fmi2Status fmi2CompletedIntegratorStep(P, fmi2Boolean no_restore, fmi2Boolean *event, fmi2Boolean *end) {
    *event = *end = fmi2False;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetTime(P, double t) {
    p->time = t;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetContinuousStates(P, const double x[], size_t n) {
    memcpy(p->x, x, n * sizeof *x);
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetContinuousStates(P, double x[], size_t n) {
    memcpy(x, p->x, n * sizeof *x);
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(P, double x[], size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = 1;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetEventIndicators(P, double z[], size_t n) {
    z[0] = p->resting ? 1 : p->x[H];
    z[1] = p->x[GUST] - 0.5;
    return fmi2OK;
}
