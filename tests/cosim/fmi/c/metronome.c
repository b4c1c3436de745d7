/* An FMI 3.0 FMU for Co-Simulation with event mode, clocks and text; strict about the order of calls.

     x' = rate; where x comes to 1 it goes back to 0 (a state event): wraps counts, the clock wrap ticks
     beats counts time events, one at every multiple of beat (none if it is 0)
     samples, ticks, owns count the ticks of the clocks sample, tick, own; entries those into event mode;
     sampled = u at a tick of sample, kicked sums kick_by, wrapped_at is the time of the last wrap
     echo = word with "!", reversed = data backwards

   Event mode used: the events are handled there, at their instant if early return is allowed, else at the
   end of the step; without, inside the step. Discrete inputs are set in event mode only, clocked variables
   while their clock is active. From the time `stuck` on doStep returns early without progress. An event
   with a negative rate asks to end the simulation. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))
#define P struct metronome *p

enum { RATE = 1, U, X, WRAPS, BEATS, BEAT, STUCK, ENTRIES };
enum { WRAP = 20, SAMPLE, TICK, OWN, KICK, OWN_PERIOD, KICK_BY, SAMPLED, TICKS, OWNS, KICKED, WRAPPED_AT, SAMPLES };
enum { WORD = 40, ECHO, DATA, REVERSED };
enum mode { INSTANTIATED, INITIALIZING, EVENT, STEP };

struct metronome {
    enum mode mode;
    bool event_mode, early_return, active[64];
    double v[64], time, interval;
    char word[64], echo[66];
    uint8_t data[64], reversed[64];
    size_t size;
    fmi3LogMessageCallback log;
};

static fmi3Status fail(struct metronome *p, const char *format, ...) {
    char text[200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    p->log(NULL, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

static int clock_of(unsigned vr) {
    switch (vr) {
    case KICK_BY: case KICKED: return KICK;
    case SAMPLED: case SAMPLES: return SAMPLE;
    case TICKS: return TICK;
    case OWNS: return OWN;
    case WRAPPED_AT: return WRAP;
    default: return 0;
    }
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                         bool logging, bool event_mode, bool early_return,
                                         const fmi3ValueReference required[], size_t n, void *environment,
                                         fmi3LogMessageCallback log, void *update) {
    if (!strcmp(token, "toolless")) return NULL;
    struct metronome *p = calloc(1, sizeof *p);
    p->event_mode = event_mode;
    p->early_return = early_return;
    p->v[RATE] = 1.0; /* as in modelDescription.xml */
    p->v[BEAT] = 0.75;
    p->v[STUCK] = 1e9;
    p->v[OWN_PERIOD] = 1.0;
    p->interval = 0.25;
    strcpy(p->word, "a");
    p->log = log;
    return p;
}
EXPORT void fmi3FreeInstance(P) { free(p); }

EXPORT fmi3Status fmi3EnterInitializationMode(P, bool has_tolerance, double tolerance, double start, bool has_stop,
                                              double stop) {
    p->time = start;
    p->mode = INITIALIZING;
    return fmi3OK;
}
EXPORT fmi3Status fmi3ExitInitializationMode(P) {
    p->mode = p->event_mode ? EVENT : STEP;
    return fmi3OK;
}
EXPORT fmi3Status fmi3Terminate(P) { return fmi3OK; }

EXPORT fmi3Status fmi3GetFMUState(P, void **state) {
    *state = memcpy(malloc(sizeof *p), p, sizeof *p);
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetFMUState(P, void *state) {
    memcpy(p, state, sizeof *p);
    return fmi3OK;
}
EXPORT fmi3Status fmi3FreeFMUState(P, void **state) {
    free(*state);
    *state = NULL;
    return fmi3OK;
}

/* --- events */

static double next_beat(const struct metronome *p) {
    return p->v[BEAT] > 0.0 ? (p->v[BEATS] + 1.0) * p->v[BEAT] : INFINITY;
}
static void wrap(struct metronome *p) {
    p->v[X] -= 1.0;
    p->v[WRAPS] += 1.0;
}

EXPORT fmi3Status fmi3EnterEventMode(P) {
    if (p->mode != STEP || !p->event_mode) return fail(p, "event mode entered in mode %d", p->mode);
    p->mode = EVENT;
    p->v[ENTRIES] += 1.0;
    p->active[WRAP] = p->v[X] >= 1.0;
    return fmi3OK;
}
EXPORT fmi3Status fmi3EnterStepMode(P) {
    if (p->mode != EVENT) return fail(p, "step mode entered in mode %d", p->mode);
    p->mode = STEP;
    return fmi3OK;
}
EXPORT fmi3Status fmi3UpdateDiscreteStates(P, bool *again, bool *end, bool *nominals, bool *states, bool *timed,
                                           double *next) {
    if (p->mode != EVENT) return fail(p, "discrete states updated in mode %d", p->mode);
    if (p->active[WRAP]) wrap(p);
    while (p->time >= next_beat(p)) p->v[BEATS] += 1.0;
    if (p->active[KICK]) p->v[KICKED] += p->v[KICK_BY];
    memset(p->active, 0, sizeof p->active);
    *again = p->active[WRAP] = p->v[X] >= 1.0;
    *end = p->v[RATE] < 0.0;
    *nominals = *states = false;
    *timed = p->v[BEAT] > 0.0;
    *next = next_beat(p);
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(P, double t, double h, bool no_restore, bool *event, bool *terminate, bool *early,
                             double *last) {
    double end = t + h;
    *event = *terminate = *early = false;
    *last = t;
    if (p->mode != STEP || h <= 0.0) return fail(p, "step of %g s in mode %d", h, p->mode);
    if (fabs(t - p->time) > 1e-9) return fail(p, "step from %.17g s, it is at %.17g s", t, p->time);
    if (p->event_mode && next_beat(p) < t - 1e-9) return fail(p, "the time event at %g s is over", next_beat(p));
    if (p->event_mode && next_beat(p) < end - 1e-9) return fail(p, "a step over %g s", next_beat(p));
    if (t >= p->v[STUCK]) return *early = true, fmi3OK;
    p->time = t;
    while (p->time < end) {
        double to_wrap = p->time + (1.0 - p->v[X]) / p->v[RATE], to_beat = p->event_mode ? end : next_beat(p);
        double to = fmin(end, fmin(to_beat, *event ? end : to_wrap));
        p->v[X] = to == to_wrap ? 1.0 : p->v[X] + p->v[RATE] * (to - p->time);
        p->time = to;
        if (!p->event_mode) {
            if (p->v[X] >= 1.0) wrap(p);
            while (p->time >= next_beat(p)) p->v[BEATS] += 1.0;
        } else if (p->v[X] >= 1.0) {
            *event = true;
            *early = p->early_return && p->time < end;
            if (*early) break;
        }
    }
    *last = p->time;
    return fmi3OK;
}

/* --- values */

static fmi3Status may_get(struct metronome *p, unsigned vr) {
    int clock = clock_of(vr);
    if (clock && !p->active[clock]) return fail(p, "variable %u read, its clock %d is not active", vr, clock);
    return fmi3OK;
}
static fmi3Status may_set(struct metronome *p, unsigned vr) {
    bool discrete = vr == RATE || vr == WORD || vr == DATA || clock_of(vr);
    if (p->event_mode && discrete && p->mode == STEP) return fail(p, "variable %u set in step mode", vr);
    if (p->mode == INSTANTIATED) return fmi3OK;
    if (clock_of(vr) && !p->active[clock_of(vr)]) return fail(p, "variable %u set, its clock is not active", vr);
    return fmi3OK;
}

#define VALUES(name, type)                                                                                   \
    EXPORT fmi3Status fmi3Get##name(P, const unsigned vr[], size_t n, type values[], size_t n_values) {      \
        for (size_t i = 0; i < n; i++) {                                                                     \
            if (may_get(p, vr[i])) return fmi3Error;                                                         \
            values[i] = (type)(vr[i] == WRAPPED_AT ? p->time                                                 \
                               : p->v[vr[i]] + (vr[i] == KICKED ? p->v[KICK_BY] : 0.0));                     \
        }                                                                                                    \
        return fmi3OK;                                                                                       \
    }                                                                                                        \
    EXPORT fmi3Status fmi3Set##name(P, const unsigned vr[], size_t n, const type values[], size_t n_values) {\
        for (size_t i = 0; i < n; i++) {                                                                     \
            if (may_set(p, vr[i])) return fmi3Error;                                                         \
            p->v[vr[i]] = (double)values[i];                                                                 \
        }                                                                                                    \
        return fmi3OK;                                                                                       \
    }
VALUES(Float64, double)
VALUES(Int32, int32_t)

EXPORT fmi3Status fmi3SetString(P, const unsigned vr[], size_t n, const fmi3String values[], size_t n_values) {
    if (n != 1 || vr[0] != WORD || strlen(values[0]) > 60) return fail(p, "no such string");
    if (may_set(p, vr[0])) return fmi3Error;
    strcpy(p->word, values[0]);
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetString(P, const unsigned vr[], size_t n, fmi3String values[], size_t n_values) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != WORD && vr[i] != ECHO) return fail(p, "no such string");
        snprintf(p->echo, sizeof p->echo, "%s!", p->word);
        values[i] = vr[i] == WORD ? p->word : p->echo;
    }
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetBinary(P, const unsigned vr[], size_t n, const size_t sizes[], const fmi3Binary values[],
                                size_t n_values) {
    if (n != 1 || vr[0] != DATA || sizes[0] > 64) return fail(p, "no such data");
    if (may_set(p, vr[0])) return fmi3Error;
    p->size = sizes[0];
    memcpy(p->data, values[0], sizes[0]);
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetBinary(P, const unsigned vr[], size_t n, size_t sizes[], fmi3Binary values[],
                                size_t n_values) {
    if (n != 1 || (vr[0] != DATA && vr[0] != REVERSED)) return fail(p, "no such data");
    for (size_t i = 0; i < p->size; i++) p->reversed[i] = p->data[p->size - 1 - i];
    values[0] = vr[0] == DATA ? p->data : p->reversed;
    sizes[0] = p->size;
    return fmi3OK;
}

/* --- clocks */

EXPORT fmi3Status fmi3SetClock(P, const unsigned vr[], size_t n, const bool values[]) {
    if (p->mode != EVENT) return fail(p, "clock set in mode %d", p->mode);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < SAMPLE || vr[i] > KICK) return fail(p, "%u is no input clock", vr[i]);
        p->active[vr[i]] = values[i];
        if (!values[i]) continue;
        if (vr[i] == SAMPLE) p->v[SAMPLED] = p->v[U];
        if (vr[i] != KICK) p->v[vr[i] == SAMPLE ? SAMPLES : vr[i] == TICK ? TICKS : OWNS] += 1.0;
    }
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetClock(P, const unsigned vr[], size_t n, bool values[]) {
    if (p->mode != EVENT) return fail(p, "clock read in mode %d", p->mode);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != WRAP) return fail(p, "%u is no output clock", vr[i]);
        values[i] = p->active[WRAP];
    }
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetIntervalDecimal(P, const unsigned vr[], size_t n, const double intervals[]) {
    if (n != 1 || vr[0] != TICK || p->mode != INITIALIZING) return fail(p, "interval set in mode %d", p->mode);
    p->interval = intervals[0];
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetIntervalDecimal(P, const unsigned vr[], size_t n, double intervals[], int qualifiers[]) {
    if (n != 1 || (vr[0] != OWN && vr[0] != TICK)) return fail(p, "interval of %u", vr[0]);
    intervals[0] = vr[0] == OWN ? p->v[OWN_PERIOD] : p->interval;
    qualifiers[0] = 2;
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetShiftDecimal(P, const unsigned vr[], size_t n, double shifts[]) {
    shifts[0] = vr[0] == OWN ? p->v[OWN_PERIOD] / 2.0 : 0.0;
    return fmi3OK;
}
