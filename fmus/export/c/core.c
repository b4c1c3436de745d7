/* Life cycle of an instance, values and stepping. See core.h for the contract. */

#include "core.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Legal order of calls: the modes in which an operation may be called. */
#define BEFORE_INITIALIZATION (INSTANTIATED | PREPARED)
#define RUNNING (EVENT | CONTINUOUS_TIME | STEPPING)
#define READABLE (INITIALIZING | RUNNING | TERMINATED | BROKEN)
#define ANY (BEFORE_INITIALIZATION | READABLE)

#define SELDOM __attribute__((noinline, cold))
/* For loops over a few ports, where vector code costs more than it saves. */
#define PLAIN_LOOP _Pragma("clang loop vectorize(disable) unroll(disable)")

static const unsigned legal[OPERATIONS] = {
    [SET_LOGGING] = ANY,
    [PREPARE] = BEFORE_INITIALIZATION,
    [ENTER_INITIALIZATION] = PREPARED,
    [EXIT_INITIALIZATION] = INITIALIZING,
    [TERMINATE] = RUNNING,
    [RESET] = ANY,
    [GET_VALUES] = READABLE,
    [SET_VALUES] = BEFORE_INITIALIZATION | INITIALIZING | RUNNING,
    [GET_SNAPSHOT] = ANY,
    [SET_SNAPSHOT] = ANY,
    [FREE_SNAPSHOT] = ANY,
    [DIFFERENTIATE] = INITIALIZING | RUNNING | TERMINATED,
    [ENTER_EVENT] = CONTINUOUS_TIME | EVENT,
    [UPDATE_DISCRETE] = EVENT,
    [EVALUATE_DISCRETE] = INITIALIZING | EVENT,
    [ENTER_CONTINUOUS_TIME] = EVENT,
    [COMPLETE_STEP] = CONTINUOUS_TIME,
    [SET_TIME] = EVENT | CONTINUOUS_TIME,
    [SET_STATES] = CONTINUOUS_TIME,
    [GET_STATES] = INITIALIZING | EVENT | CONTINUOUS_TIME | TERMINATED | BROKEN,
    [GET_DERIVATIVES] = INITIALIZING | EVENT | CONTINUOUS_TIME | TERMINATED | BROKEN,
    [DO_STEP] = STEPPING,
    [STEP_STATUS] = STEPPING | TERMINATED | BROKEN,
    [NEVER] = 0,
};

/* Modes in which a variable may be written: states and parameters have exact start values,
   outputs and derivatives are computed. */
static const unsigned writable[ZONES] = {
    [INPUT] = BEFORE_INITIALIZATION | INITIALIZING | RUNNING,
    [STATE] = BEFORE_INITIALIZATION | INITIALIZING,
    [PARAMETER] = BEFORE_INITIALIZATION | INITIALIZING,
};

static const char *const zone_noun[ZONES] = {"input", "output", "state", "derivative", "local", "parameter"};

static const char *mode_name(enum mode mode) {
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case PREPARED: return "instantiated, experiment set up";
    case INITIALIZING: return "initialization mode";
    case EVENT: return "event mode";
    case CONTINUOUS_TIME: return "continuous-time mode";
    case STEPPING: return "step mode";
    case TERMINATED: return "terminated";
    case BROKEN: return "stopped by an error (reset it or restore a state)";
    }
    return "an unknown mode";
}

/* --- log ------------------------------------------------------------------------------------ */

SELDOM static void write_log(struct instance *c, status s, const char *category, const char *function,
                      const char *format, va_list arguments) {
    char text[512];
    int used = snprintf(text, sizeof text, "%s: ", function);
    if (used < 0 || (size_t)used >= sizeof text) used = 0;
    vsnprintf(text + used, sizeof text - (size_t)used, format, arguments);
    if (c->sink && c->logger) c->sink(c, s, category, text);
}

SELDOM status core_refuse(struct instance *c, const char *function, const char *format, ...) {
    if (c->log_errors) {
        va_list arguments;
        va_start(arguments, format);
        write_log(c, FAILED, LOG_ERROR, function, format, arguments);
        va_end(arguments);
    }
    return FAILED;
}

__attribute__((format(printf, 3, 4))) static void tell(struct instance *c, const char *function,
                                                       const char *format, ...) {
    if (!c->log_events) return;
    va_list arguments;
    va_start(arguments, format);
    write_log(c, OK, LOG_EVENT, function, format, arguments);
    va_end(arguments);
}

status core_set_logging(struct instance *c, bool on, size_t n, const char *const categories[],
                        const char *function) {
    if (core_need(c, categories, n, "categories", function)) return FAILED;
    bool errors = n == 0, events = n == 0;
    for (size_t i = 0; i < n; i++) {
        const char *name = categories[i] ? categories[i] : "NULL";
        if (!strcmp(name, LOG_ERROR)) errors = true;
        else if (!strcmp(name, LOG_EVENT)) events = true;
        else return core_refuse(c, function, "unknown log category %s (" LOG_ERROR ", " LOG_EVENT ")", name);
    }
    if (errors) c->log_errors = on;
    if (events) c->log_events = on;
    return OK;
}

bool core_allows(struct instance *c, enum operation operation, const char *function) {
    if (!c) return false;
    if (legal[operation] & c->mode) return true;
    core_refuse(c, function, "not allowed now, the instance is in: %s", mode_name(c->mode));
    return false;
}

status core_need(struct instance *c, const void *pointer, size_t n, const char *what, const char *function) {
    if (pointer || n == 0) return OK;
    return core_refuse(c, function, "%s is NULL", what);
}

/* --- instance ------------------------------------------------------------------------------- */

static void load_start(struct instance *c) {
    memcpy(c->settings, model.start, model.n_slots * sizeof(double));
    memcpy(c->storage, model.start, model.n_slots * sizeof(double));
    c->mode = INSTANTIATED;
    c->t = c->start_time = 0.0;
    c->stop_time = INFINITY;
    c->step = 0.0;
    c->stale = true;
}

static bool offers(enum interface interface) {
    bool has_states = model.zone[STATE] < model.zone[STATE + 1];
    if (interface == CO_SIMULATION) return true;
    return interface == MODEL_EXCHANGE && !model.step && (model.derivatives || !has_states);
}

struct instance *core_new(const char *name, const char *token, enum interface interface, bool logging,
                          log_sink *sink, void (*logger)(void), void *environment) {
    struct instance draft = {.name = (char[]){"?"}, .log_errors = true, .sink = sink, .logger = logger,
                             .environment = environment};
    const char *here = "instantiate";
    if (!name || !*name) {
        core_refuse(&draft, here, "the instance has no name");
        return NULL;
    }
    draft.name = (char *)name;
    if (!token || strcmp(token, model.token)) {
        core_refuse(&draft, here, "GUID %s is not that of this library, %s: modelDescription.xml and binary "
                    "come from different exports", token ? token : "NULL", model.token);
        return NULL;
    }
    if (!offers(interface)) {
        core_refuse(&draft, here, "%s has no interface for %s", model.identifier,
                    interface == MODEL_EXCHANGE ? "Model Exchange" : "this kind of simulation");
        return NULL;
    }
    struct instance *c = calloc(1, sizeof *c);
    char *own_name = malloc(strlen(name) + 1);
    double *memory = calloc(3 * (size_t)model.n_slots + 1, sizeof(double));
    if (!c || !own_name || !memory) {
        free(c), free(own_name), free(memory);
        core_refuse(&draft, here, "out of memory for a storage of %u doubles", (unsigned)model.n_slots);
        return NULL;
    }
    *c = draft;
    c->name = strcpy(own_name, name);
    c->interface = interface;
    c->log_errors = c->log_events = logging;
    c->storage = memory;
    c->settings = memory + model.n_slots;
    c->trial = memory + 2 * (size_t)model.n_slots;
    load_start(c);
    return c;
}

void core_free(struct instance *c) {
    if (!c) return;
    free(c->storage);
    free(c->name);
    free(c);
}

status core_prepare(struct instance *c, double start, bool stop_defined, double stop, const char *function) {
    if (!isfinite(start)) return core_refuse(c, function, "start time %g is not finite", start);
    if (stop_defined && !(stop >= start))
        return core_refuse(c, function, "stop time %g is before start time %g", stop, start);
    c->t = c->start_time = start;
    c->stop_time = stop_defined ? stop : INFINITY;
    c->mode = PREPARED;
    c->stale = true;
    return OK;
}

status core_enter_initialization(struct instance *c) {
    c->mode = INITIALIZING;
    return OK;
}

status core_exit_initialization(struct instance *c, const char *function) {
    if (core_evaluate(c, function)) return FAILED;
    c->mode = c->interface == MODEL_EXCHANGE ? EVENT : STEPPING;
    tell(c, function, "initialized at t = %g", c->t);
    return OK;
}

status core_terminate(struct instance *c) {
    c->mode = TERMINATED;
    return OK;
}

status core_reset(struct instance *c) {
    load_start(c);
    return OK;
}

/* --- evaluation ----------------------------------------------------------------------------- */

uint32_t core_first_not_finite(const double *storage, uint32_t first, uint32_t last) {
    uint64_t bad = 0; /* all bits of the exponent set: infinity or NaN; no branch per slot */
    PLAIN_LOOP
    for (uint32_t i = first; i < last; i++) {
        uint64_t bits;
        memcpy(&bits, storage + i, sizeof bits);
        bad |= (bits & 0x7ff0000000000000u) == 0x7ff0000000000000u;
    }
    if (!bad) return last;
    while (first < last && isfinite(storage[first])) first++;
    return first;
}

int32_t core_run(double *storage, double t) {
    int32_t code = model.derivatives ? model.derivatives(storage, t, 0.0) : 0;
    if (!code && model.outputs) code = model.outputs(storage, t, 0.0);
    return code;
}

SELDOM static status not_finite(struct instance *c, uint32_t slot, const char *function) {
    char name[128];
    core_slot_name(slot, name, sizeof name);
    return core_refuse(c, function, "%s became %g at t = %.9g", name, c->storage[slot], c->t);
}

status core_evaluate(struct instance *c, const char *function) {
    if (!c->stale) return OK;
    if (c->mode & (BEFORE_INITIALIZATION | INITIALIZING)) {
        memcpy(c->storage, c->settings, model.n_slots * sizeof(double));
        int32_t code = model.initialize ? model.initialize(c->storage, c->t, 0.0) : 0;
        if (code) return core_refuse(c, function, "initialize failed (code %d)", (int)code);
    }
    int32_t code = core_run(c->storage, c->t);
    if (code) return core_refuse(c, function, "the equations failed at t = %.9g (code %d)", c->t, (int)code);
    static const enum zone computed[] = {OUTPUT, DERIVATIVE}; /* inputs and states are checked when they are set */
    for (int i = 0; i < 2; i++) {
        uint32_t last = model.zone[computed[i] + 1];
        uint32_t slot = core_first_not_finite(c->storage, model.zone[computed[i]], last);
        if (slot < last) return not_finite(c, slot, function);
    }
    c->stale = false;
    return OK;
}

/* --- values --------------------------------------------------------------------------------- */

const struct variable *core_locate(uint32_t slot) {
    if (slot >= model.n_slots || !model.n_variables) return NULL;
    uint32_t low = 0, high = model.n_variables; /* variables[low].first <= slot < variables[high].first */
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (model.variables[middle].first <= slot) low = middle;
        else high = middle;
    }
    const struct variable *v = &model.variables[low];
    return slot - v->first < v->size ? v : NULL; /* also NULL before the first variable */
}

void core_slot_name(uint32_t slot, char *text, size_t size) {
    const struct variable *v = core_locate(slot);
    int used = snprintf(text, size, "%s%s", v ? v->name : "?", v && v->rank ? "[" : "");
    uint32_t rest = v ? slot - v->first : 0, stride = v ? v->size : 1;
    for (uint32_t axis = 0; v && axis < v->rank && used >= 0 && (size_t)used < size; axis++) {
        stride /= v->shape[axis];
        used += snprintf(text + used, size - (size_t)used, "%u%s", (unsigned)(rest / stride + 1),
                         axis + 1 < v->rank ? "," : "]");
        rest %= stride;
    }
}

uint32_t core_extent(uint32_t reference, bool whole, const struct variable **variable) {
    const struct variable *v = *variable = core_locate(reference);
    if (!v || !v->listed || (whole && v->first != reference)) return 0;
    return whole ? v->size : 1;
}

/* A master's loop reads and writes elements of zones that are all readable or writable, so that no
   search is needed. True when every reference lies below `end`; `*computed`: one of them is not an input. */
static bool all_below(uint32_t end, const uint32_t *references, size_t n, bool *computed) {
    uint32_t largest = 0;
    PLAIN_LOOP
    for (size_t i = 0; i < n; i++)
        if (references[i] > largest) largest = references[i];
    *computed = largest >= model.zone[OUTPUT];
    return n > 0 && largest < end;
}

static status count(struct instance *c, size_t have, size_t want, const char *function) {
    if (have == want) return OK;
    return core_refuse(c, function, "%zu values for variables of %zu elements", have, want);
}

__attribute__((noinline)) static status get_any(struct instance *c, const uint32_t *references, size_t n,
                                                double *values, size_t n_values, bool whole,
                                                const char *function) {
    if (core_need(c, references, n, "valueReferences", function)) return FAILED;
    if (core_need(c, values, n_values, "values", function)) return FAILED;
    size_t total = 0;
    bool computed = false;
    for (size_t i = 0; i < n; i++) {
        const struct variable *v;
        bool time = whole && references[i] == model.n_slots;
        uint32_t size = time ? 1 : core_extent(references[i], whole, &v);
        if (!size) return core_refuse(c, function, "unknown value reference %u", (unsigned)references[i]);
        computed |= !time && v->zone != INPUT && v->zone != PARAMETER;
        total += size;
    }
    if (count(c, n_values, total, function)) return FAILED;
    if (computed && core_evaluate(c, function)) return FAILED;
    const double *source = c->mode == INITIALIZING && c->stale ? c->settings : c->storage;
    for (size_t i = 0; i < n; i++) {
        const struct variable *v;
        if (references[i] == model.n_slots) *values++ = c->t;
        else {
            uint32_t size = core_extent(references[i], whole, &v);
            memcpy(values, source + references[i], size * sizeof(double));
            values += size;
        }
    }
    return OK;
}

status core_get(struct instance *c, const uint32_t *references, size_t n, double *values, size_t n_values,
                bool whole, const char *function) {
    bool computed;
    if (whole || !references || !values || (c->mode & INITIALIZING) ||
        !all_below(model.zone[LOCAL], references, n, &computed))
        return get_any(c, references, n, values, n_values, whole, function);
    if (computed && core_evaluate(c, function)) return FAILED;
    PLAIN_LOOP
    for (size_t i = 0; i < n; i++) values[i] = c->storage[references[i]];
    return OK;
}

static status check_writable(struct instance *c, const struct variable *v, uint32_t first, uint32_t size,
                             const double *values, const char *function) {
    if (!(writable[v->zone] & c->mode))
        return core_refuse(c, function, "%s %s cannot be set %s: %s", zone_noun[v->zone], v->name,
                           writable[v->zone] ? "now" : "at all", mode_name(c->mode));
    for (uint32_t k = 0; k < size; k++) {
        char name[128];
        bool bounded = v->zone == PARAMETER && !isnan(values[k]); /* a parameter may be infinite: no limit */
        if (bounded ? values[k] >= v->min && values[k] <= v->max : isfinite(values[k])) continue;
        core_slot_name(first + k, name, sizeof name);
        if (bounded)
            return core_refuse(c, function, "%s = %g is outside [%g, %g]", name, values[k], v->min, v->max);
        return core_refuse(c, function, "%s = %g is not finite", name, values[k]);
    }
    return OK;
}

__attribute__((noinline)) static status set_any(struct instance *c, const uint32_t *references, size_t n,
                                                const double *values, size_t n_values, bool whole,
                                                const char *function) {
    if (core_need(c, references, n, "valueReferences", function)) return FAILED;
    if (core_need(c, values, n_values, "values", function)) return FAILED;
    size_t total = 0;
    for (size_t i = 0; i < n; i++) { /* all or nothing: check before the first write */
        const struct variable *v;
        uint32_t size = core_extent(references[i], whole, &v);
        if (!size) return core_refuse(c, function, "unknown value reference %u", (unsigned)references[i]);
        if (total + size > n_values) return count(c, n_values, total + size, function);
        if (check_writable(c, v, references[i], size, values + total, function)) return FAILED;
        total += size;
    }
    if (count(c, n_values, total, function)) return FAILED;
    bool early = c->mode & (BEFORE_INITIALIZATION | INITIALIZING);
    double *target = early ? c->settings : c->storage;
    for (size_t i = 0; i < n; i++) {
        const struct variable *v;
        uint32_t size = core_extent(references[i], whole, &v);
        memcpy(target + references[i], values, size * sizeof(double));
        values += size;
    }
    if (n) c->stale = true;
    return OK;
}

status core_set(struct instance *c, const uint32_t *references, size_t n, const double *values,
                size_t n_values, bool whole, const char *function) {
    bool computed;
    if (whole || !references || !values || !(c->mode & RUNNING) ||
        !all_below(model.zone[OUTPUT], references, n, &computed) ||
        core_first_not_finite(values, 0, (uint32_t)n) < n)
        return set_any(c, references, n, values, n_values, whole, function);
    PLAIN_LOOP
    for (size_t i = 0; i < n; i++) c->storage[references[i]] = values[i];
    c->stale = true;
    return OK;
}

/* --- Model Exchange ------------------------------------------------------------------------- */

status core_set_time(struct instance *c, double t, const char *function) {
    if (!isfinite(t)) return core_refuse(c, function, "time %g is not finite", t);
    c->t = t;
    c->stale = true;
    return OK;
}

static status zone_size(struct instance *c, enum zone zone, const double *x, size_t n, const char *function) {
    uint32_t size = model.zone[zone + 1] - model.zone[zone];
    if (n != size)
        return core_refuse(c, function, "%zu values for %u %ss", n, (unsigned)size, zone_noun[zone]);
    return core_need(c, x, n, "array", function);
}

status core_set_states(struct instance *c, const double *x, size_t n, const char *function) {
    if (zone_size(c, STATE, x, n, function)) return FAILED;
    for (size_t i = 0; i < n; i++) {
        char name[128];
        if (isfinite(x[i])) continue;
        core_slot_name(model.zone[STATE] + (uint32_t)i, name, sizeof name);
        return core_refuse(c, function, "%s = %g is not finite", name, x[i]);
    }
    if (n) memcpy(c->storage + model.zone[STATE], x, n * sizeof(double));
    c->stale = true;
    return OK;
}

status core_get_zone(struct instance *c, enum zone zone, double *x, size_t n, const char *function) {
    if (zone_size(c, zone, x, n, function)) return FAILED;
    if ((zone == DERIVATIVE || c->mode == INITIALIZING) && core_evaluate(c, function)) return FAILED;
    if (n) memcpy(x, c->storage + model.zone[zone], n * sizeof(double));
    return OK;
}

/* --- Co-Simulation -------------------------------------------------------------------------- */

status core_step(struct instance *c, double t, double h, const char *function) {
    if (!isfinite(t) || !isfinite(h)) return core_refuse(c, function, "t = %g, step = %g: not finite", t, h);
    if (!(h > 0.0)) return core_refuse(c, function, "step %g is not positive", h);
    /* A hundredth of a step, and the host's rounding of t; a larger difference is another time. */
    double slack = 0.01 * h + 2.0 * DBL_EPSILON * fabs(t);
    if (fabs(t - c->t) > slack)
        return core_refuse(c, function, "step from t = %.17g, but the instance is at %.17g", t, c->t);
    if (t + h > c->stop_time + slack)
        return core_refuse(c, function, "step to %.17g passes the stop time %.17g", t + h, c->stop_time);
    /* Hosts compute h as a difference of times, so the last bits of equal steps differ. Models keep
       matrices that belong to a step, so a difference within rounding of t does not count. */
    if (fabs(h - c->step) > 8.0 * DBL_EPSILON * (fabs(t) + h)) c->step = h;
    model_kernel *kernel = model.step ? model.step : model.advance;
    int32_t code = kernel ? kernel(c->storage, t, c->step) : 0;
    c->t = t + h;
    c->stale = true;
    if (code) {
        c->mode = BROKEN;
        return core_refuse(c, function, "the model failed in the step from t = %.9g (code %d)", t, (int)code);
    }
    uint32_t first = model.zone[model.step ? OUTPUT : STATE], last = model.zone[STATE + 1];
    uint32_t slot = core_first_not_finite(c->storage, first, last);
    if (slot < last) {
        c->mode = BROKEN;
        return not_finite(c, slot, function);
    }
    return OK;
}
