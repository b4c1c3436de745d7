/* The part of an FMU that both versions of FMI share: instances, order of calls,
   evaluation, stepping, snapshots, directional derivatives.

   Contract of every function that returns `status`
   - OK:      done.
   - FAILED:  one line went to the log. Either the call was refused and changed
              nothing (wrong argument or wrong mode), or the model itself failed
              (a kernel failed, a result is not finite) and the instance is in BROKEN:
              it can still be read, reset, restored from a snapshot and freed.
   Time belongs to the host: t is the last time that the host passed, never a running sum.

   No function keeps anything outside its instance: a process can have any number of
   instances, each in a thread of its own. */

#ifndef STRUCTCOSIM_CORE_H
#define STRUCTCOSIM_CORE_H

#include "model.h"

typedef int status;
enum { OK = 0, FAILED = 3 }; /* the numbers of fmi2OK, fmi2Error, fmi3OK, fmi3Error */

enum interface { MODEL_EXCHANGE = 1, CO_SIMULATION = 2 };

/* One bit each, so that a set of modes is a number. */
enum mode {
    INSTANTIATED = 1 << 0,
    PREPARED = 1 << 1, /* start time is known */
    INITIALIZING = 1 << 2,
    EVENT = 1 << 3,           /* Model Exchange */
    CONTINUOUS_TIME = 1 << 4, /* Model Exchange */
    STEPPING = 1 << 5,        /* Co-Simulation */
    TERMINATED = 1 << 6,
    BROKEN = 1 << 7
};

/* Operations whose legality depends on the mode: rows of a table in core.c. */
enum operation {
    SET_LOGGING,
    PREPARE,
    ENTER_INITIALIZATION,
    EXIT_INITIALIZATION,
    TERMINATE,
    RESET,
    GET_VALUES,
    SET_VALUES,
    GET_SNAPSHOT,
    SET_SNAPSHOT,
    FREE_SNAPSHOT,
    DIFFERENTIATE,
    ENTER_EVENT,
    UPDATE_DISCRETE,
    EVALUATE_DISCRETE,
    ENTER_CONTINUOUS_TIME,
    COMPLETE_STEP,
    SET_TIME,
    SET_STATES,
    GET_STATES,
    GET_DERIVATIVES,
    DO_STEP,
    STEP_STATUS,
    NEVER, /* functions for event mode in Co-Simulation, configuration mode or clocks */
    OPERATIONS
};

struct instance;
typedef void log_sink(const struct instance *, status, const char *category, const char *message);

struct instance {
    char *name;
    enum interface interface;
    enum mode mode;
    double t;
    double start_time;
    double stop_time;   /* +inf: not defined */
    double step;        /* last communication step; 0: none yet */
    bool stale;         /* outputs and derivatives are out of date */
    double *storage;    /* the model's variables */
    double *settings;   /* until initialisation ends: the storage as set, before `initialize` */
    double *trial;      /* work space of directional derivatives */
    bool log_errors, log_events;
    log_sink *sink;     /* of the FMI version; calls `logger` with the host's signature */
    void (*logger)(void);
    void *environment;
};

#define LOG_ERROR "logStatusError"
#define LOG_EVENT "logEvents"

/* Instance. `core_new` returns NULL after a line in the log; that line is written
   even when logging is off, because NULL says nothing. */
struct instance *core_new(const char *name, const char *token, enum interface, bool logging,
                          log_sink *, void (*logger)(void), void *environment);
void core_free(struct instance *);
status core_set_logging(struct instance *, bool on, size_t n, const char *const categories[],
                        const char *function);

/* True when `operation` is legal now; otherwise writes one line to the log (none for NULL). */
bool core_allows(struct instance *, enum operation, const char *function);

/* Write one line to the log, "function: ...", and return FAILED. */
__attribute__((format(printf, 3, 4))) status core_refuse(struct instance *, const char *function,
                                                         const char *format, ...);
/* Return FAILED, with a line in the log, when `pointer` is NULL although `n` > 0. */
status core_need(struct instance *, const void *pointer, size_t n, const char *what,
                 const char *function);

/* Life cycle. The caller has checked core_allows. */
status core_prepare(struct instance *, double start, bool stop_defined, double stop, const char *function);
status core_enter_initialization(struct instance *);
status core_exit_initialization(struct instance *, const char *function);
status core_terminate(struct instance *);
status core_reset(struct instance *);

/* Values. A reference is a slot (FMI 2: one variable per element) or, with `whole`, the first slot
   of a variable that is passed with all its elements (FMI 3); then reference n_slots is time. */
status core_get(struct instance *, const uint32_t *references, size_t n, double *values, size_t n_values,
                bool whole, const char *function);
status core_set(struct instance *, const uint32_t *references, size_t n, const double *values,
                size_t n_values, bool whole, const char *function);
/* Bring outputs and derivatives up to date with time, states, inputs and parameters. */
status core_evaluate(struct instance *, const char *function);

/* Model Exchange. */
status core_set_time(struct instance *, double t, const char *function);
status core_set_states(struct instance *, const double *x, size_t n, const char *function);
status core_get_zone(struct instance *, enum zone, double *x, size_t n, const char *function);

/* Co-Simulation: inputs held over [t, t + h]; any h > 0. */
status core_step(struct instance *, double t, double h, const char *function);

/* Snapshots: a copy of the storage with mode and time (snapshot.c). */
status core_snapshot(struct instance *, void **snapshot, const char *function);
status core_restore(struct instance *, const void *snapshot, const char *function);
void core_forget(void **snapshot);
size_t core_serialized_size(void);
status core_serialize(struct instance *, const void *snapshot, unsigned char *bytes, size_t size,
                      const char *function);
status core_deserialize(struct instance *, const unsigned char *bytes, size_t size, void **snapshot,
                        const char *function);

/* d unknown / d known in the direction `seed` (sensitivity.c). Unknowns are outputs, states and
   derivatives, knowns inputs, states and (while initialising) parameters; references as in core_get. */
struct direction {
    const uint32_t *references;
    size_t n;
    size_t n_values; /* of seed or result */
};
status core_differentiate(struct instance *, struct direction unknown, struct direction known, bool whole,
                          const double *seed, double *result, const char *function);

/* Run derivatives, then outputs, on any storage; return 0 or the kernel's code. */
int32_t core_run(double *storage, double t);
/* Return the variable that owns a slot; NULL beyond the storage. */
const struct variable *core_locate(uint32_t slot);
/* Return the number of slots of a reference, and its variable; 0 when the reference is unknown. */
uint32_t core_extent(uint32_t reference, bool whole, const struct variable **variable);
/* Return the first slot in [first, last) that is not finite, or `last`. */
uint32_t core_first_not_finite(const double *storage, uint32_t first, uint32_t last);
/* Write the name of a slot, "accel[3]" or "K[2,3]", counted from 1. */
void core_slot_name(uint32_t slot, char *text, size_t size);

#endif
