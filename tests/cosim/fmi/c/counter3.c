/* A counter without states, as an FMI 3.0 FMU for Model Exchange; linked with rest3.c, by which the
   functions of states and indicators fail.

     count = 0, and one more at each time event, at period, period + period, ...: a running sum, so that
     it is now above and now below k period by rounding. An event at any other instant, and a call in a
     mode in which it is not allowed, is an error. The simulation is asked to end at count = last. */

#include <stdbool.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"

enum mode { START, INITIALIZATION, EVENT, CONTINUOUS };
struct counter {
    enum mode mode;
    double time, next, period;
    int count, last;
};
#define C struct counter *c
#define EXPORT __attribute__((visibility("default")))
#define NEEDS(condition) if (!(condition)) return fmi3Error

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                          bool logging, void *environment, fmi3LogMessageCallback log) {
    C = calloc(1, sizeof *c);
    c->period = 0.1; /* as in modelDescription.xml */
    c->last = 1000;
    return c;
}
EXPORT void fmi3FreeInstance(C) { free(c); }

#define ENTER(name, from, to)                                                                                \
    EXPORT fmi3Status name(C) {                                                                              \
        NEEDS(c->mode == from);                                                                              \
        c->mode = to;                                                                                        \
        return fmi3OK;                                                                                       \
    }
ENTER(fmi3EnterEventMode, CONTINUOUS, EVENT)
ENTER(fmi3EnterContinuousTimeMode, EVENT, CONTINUOUS)
ENTER(fmi3Terminate, CONTINUOUS, START)

EXPORT fmi3Status fmi3EnterInitializationMode(C, bool has_tolerance, double tolerance, double start, bool has_stop,
                                              double stop) {
    NEEDS(c->mode == START);
    c->mode = INITIALIZATION;
    c->time = start;
    return fmi3OK;
}
EXPORT fmi3Status fmi3ExitInitializationMode(C) {
    NEEDS(c->mode == INITIALIZATION);
    c->mode = EVENT;
    c->next = c->period;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(C, const unsigned vr[], size_t n, const double values[], size_t m) {
    NEEDS(c->mode == START || c->mode == INITIALIZATION);
    c->period = values[0];
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetInt32(C, const unsigned vr[], size_t n, const int values[], size_t m) {
    NEEDS(c->mode == START || c->mode == INITIALIZATION);
    c->last = values[0];
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetInt32(C, const unsigned vr[], size_t n, int values[], size_t m) {
    values[0] = c->count;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetTime(C, double t) {
    NEEDS(c->mode == EVENT || c->mode == CONTINUOUS);
    c->time = t;
    return fmi3OK;
}
EXPORT fmi3Status fmi3CompletedIntegratorStep(C, bool no_restore, bool *event, bool *end) {
    NEEDS(c->mode == CONTINUOUS);
    *event = *end = false;
    return fmi3OK;
}
EXPORT fmi3Status fmi3UpdateDiscreteStates(C, bool *again, bool *end, bool *nominals, bool *states, bool *timed,
                                           double *time) {
    NEEDS(c->mode == EVENT && (c->time == c->next || c->time == 0));
    if (c->time == c->next) {
        c->count++;
        c->next += c->period;
    }
    *again = *nominals = *states = false;
    *end = c->count >= c->last;
    *timed = true;
    *time = c->next;
    return fmi3OK;
}
