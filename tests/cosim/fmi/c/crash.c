/* An FMI 2.0 FMU that fails on demand: x' = u, y = 2 x; Co-Simulation and Model Exchange.

   The GUID of its model description selects the fault: "FUNCTION WAY TIME", such as "DoStep null 0.5",
   makes fmi2DoStep write to address 0 when its time is 0.5 or later. Before that it logs a line.
   "none choosy 0" refuses the value 3, and "none negative 0" answers a set with the status -1.
   "FUNCTION fatal TIME" answers fmi2Fatal, and crashes when it is called once more to be freed.
   "hang" makes the file that CRASH_HANGS names, then hangs.
   With CRASH_AT_LOAD in the environment, the library aborts when it is loaded. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define P struct plant *p
#define FAIL(name) crash(p, #name)

struct plant {
    char function[40], way[20], said[80];
    double time, at, u, x;
    const fmi2CallbackFunctions *f;
};

static void crash(P, const char *function) {
    if (strcmp(function, p->function) != 0 || p->time < p->at) return;
    p->f->logger(p->f->componentEnvironment, "plant", fmi2Warning, "fault", "%s is at its fault, u = %g", function, p->u);
    for (int i = 0; strcmp(p->way, "flood") == 0 && i < 500; i++)
        p->f->logger(p->f->componentEnvironment, "plant", fmi2Warning, "fault", "line %d", i);
    if (strcmp(p->way, "null") == 0) *(volatile int *)0 = 1;
    if (strcmp(p->way, "abort") == 0) abort();
    if (strcmp(p->way, "exit") == 0) exit(3);
    const char *mark = getenv("CRASH_HANGS");
    if (strcmp(p->way, "hang") == 0 && mark) fclose(fopen(mark, "w"));
    while (strcmp(p->way, "hang") == 0) sleep(1);
}

static fmi2Status answer(P, const char *function) {
    if (strcmp(p->way, "fatal") != 0 || strcmp(p->function, function) != 0) return fmi2OK;
    strcpy(p->function, "FreeInstance");
    strcpy(p->way, "null");
    return fmi2Fatal;
}

__attribute__((constructor)) static void at_load(void) {
    if (getenv("CRASH_AT_LOAD") != NULL) abort();
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                             const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    P = f->allocateMemory(1, sizeof *p);
    p->f = f;
    p->time = -1e9;
    p->at = -1e9;
    sscanf(guid, "%39s %19s %lf", p->function, p->way, &p->at);
    FAIL(Instantiate);
    return p;
}
EXPORT void fmi2FreeInstance(P) {
    FAIL(FreeInstance);
    p->f->freeMemory(p);
}

#define FAILS(name)                                                                                          \
    EXPORT fmi2Status fmi2##name(P) {                                                                        \
        FAIL(name);                                                                                          \
        return answer(p, #name);                                                                             \
    }
FAILS(Reset) FAILS(Terminate) FAILS(EnterInitializationMode) FAILS(ExitInitializationMode) FAILS(EnterEventMode)
FAILS(EnterContinuousTimeMode) FAILS(SetDebugLogging) FAILS(CancelStep)

EXPORT fmi2Status fmi2SetupExperiment(P, fmi2Boolean has_tolerance, double tolerance, double start,
                                      fmi2Boolean has_stop, double stop) {
    p->time = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(P, const unsigned vr[], size_t n, double value[]) {
    FAIL(GetReal);
    for (size_t i = 0; i < n; i++) value[i] = (double[]){p->u, p->x, p->u, 2 * p->x}[vr[i]];
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetReal(P, const unsigned vr[], size_t n, const double value[]) {
    FAIL(SetReal);
    if (strcmp(p->way, "refuse") == 0 && p->time >= p->at) return fmi2Error;
    if (strcmp(p->way, "negative") == 0) return -1;
    if (strcmp(p->way, "choosy") == 0 && value[0] == 3) return fmi2Error;
    for (size_t i = 0; i < n; i++) *(vr[i] == 0 ? &p->u : &p->x) = value[i];
    return fmi2OK;
}

/* The output string is the last one set, twice. */
EXPORT fmi2Status fmi2SetString(P, const unsigned vr[], size_t n, const fmi2String value[]) {
    snprintf(p->said, sizeof p->said, "%s%s", value[0], value[n - 1]);
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetString(P, const unsigned vr[], size_t n, fmi2String value[]) {
    for (size_t i = 0; i < n; i++) value[i] = p->said;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetDirectionalDerivative(P, const unsigned unknown[], size_t n_unknown, const unsigned known[],
                                               size_t n_known, const double seed[], double answer[]) {
    for (size_t i = 0; i < n_unknown; i++) answer[i] = 100 * unknown[i] + 10 * known[n_known - 1] + seed[n_known - 1];
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(P, double t, double h, fmi2Boolean no_restore) {
    p->time = t;
    FAIL(DoStep);
    if (strcmp(p->way, "flood") == 0 && t >= p->at) return fmi2Error;
    p->x += h * p->u;
    p->time = t + h;
    return fmi2OK;
}

EXPORT fmi2Status fmi2NewDiscreteStates(P, fmi2EventInfo *info) {
    memset(info, 0, sizeof *info);
    return fmi2OK;
}
EXPORT fmi2Status fmi2CompletedIntegratorStep(P, fmi2Boolean no_restore, fmi2Boolean *event, fmi2Boolean *end) {
    FAIL(CompletedIntegratorStep);
    *event = *end = fmi2False;
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
    FAIL(GetDerivatives);
    d[0] = p->u;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetEventIndicators(P, double z[], size_t n) { return fmi2OK; }
EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(P, double x[], size_t n) {
    x[0] = 1;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetBooleanStatus(P, fmi2StatusKind kind, fmi2Boolean *value) { return fmi2Error; }
EXPORT fmi2Status fmi2GetRealStatus(P, fmi2StatusKind kind, double *value) { return fmi2Error; }

/* The bytes of a state contain an address, so they are valid in their own process only. */
EXPORT fmi2Status fmi2GetFMUstate(P, fmi2FMUstate *state) {
    struct plant *copy = malloc(sizeof *copy), **kept = malloc(sizeof *kept);
    *copy = *p;
    *kept = copy;
    *state = kept;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SetFMUstate(P, fmi2FMUstate state) {
    const struct plant *copy = *(struct plant **)state;
    p->time = copy->time;
    p->u = copy->u;
    p->x = copy->x;
    return fmi2OK;
}
EXPORT fmi2Status fmi2FreeFMUstate(P, fmi2FMUstate *state) { /* the copy behind it stays */
    free(*state);
    *state = NULL;
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializedFMUstateSize(P, fmi2FMUstate state, size_t *size) {
    *size = sizeof(struct plant *);
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializeFMUstate(P, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    memcpy(bytes, state, size);
    return fmi2OK;
}
EXPORT fmi2Status fmi2DeSerializeFMUstate(P, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi2OK;
}
