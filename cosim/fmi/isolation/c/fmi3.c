/* FMI 3.0 of an isolated FMU: fmi3Functions.h says what the functions do. */

#include "caller.h"

#include <string.h>

#include "fmi3Functions.h"

typedef const fmi3ValueReference references;

/* ----------------------------------------------------------------------- instance */

const char *fmi3GetVersion(void) { return fmi3Version; }

static void pass_on(struct remote *r, int status, const char *category, const char *text)
{
    const fmi3LogMessageCallback log = (fmi3LogMessageCallback)caller_log_function(r);
    if (log != NULL)
        log(caller_environment(r), (fmi3Status)status, category, text);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    struct remote *r = caller_begin(pass_on, environment, (void *)log);
    if (r == NULL)
        return NULL;
    const int status = CALL(r, fmi3InstantiateModelExchange, TEXT(name), TEXT(token), TEXT(resources),
                            NUMBER(visible), NUMBER(logging));
    return status == 0 ? r : NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
                                         fmi3Boolean early, references required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    struct remote *r = caller_begin(pass_on, environment, (void *)log);
    if (r == NULL)
        return NULL;
    if (update != NULL) {
        caller_say(r, "an isolated FMU cannot call back for intermediate updates");
        return NULL;
    }
    const int status = CALL(r, fmi3InstantiateCoSimulation, TEXT(name), TEXT(token), TEXT(resources),
                            NUMBER(visible), NUMBER(logging), NUMBER(events), NUMBER(early), IN(required, n),
                            NUMBER(n));
    return status == 0 ? r : NULL;
}

/* Scheduled Execution calls back into the importer at any moment, and is not isolated. */
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    caller_say(caller_begin(pass_on, environment, (void *)log), "an isolated FMU has no Scheduled Execution");
    return NULL;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    caller_say(c, "an isolated FMU has no Scheduled Execution");
    return fmi3Error;
}

void fmi3FreeInstance(fmi3Instance c) { CALL_PLAIN(c, fmi3FreeInstance); }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    return CALL(c, fmi3SetDebugLogging, NUMBER(on), NUMBER(n), TEXTS(categories, n));
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    return CALL(caller_at(c, start, start), fmi3EnterInitializationMode, NUMBER(tolerance_defined), REAL(tolerance),
                REAL(start), NUMBER(stop_defined), REAL(stop));
}

#define PLAIN(name) \
    fmi3Status name(fmi3Instance c) { return CALL_PLAIN(c, name); }
PLAIN(fmi3ExitInitializationMode)
PLAIN(fmi3EnterEventMode)
PLAIN(fmi3Terminate)
PLAIN(fmi3Reset)
PLAIN(fmi3EnterConfigurationMode)
PLAIN(fmi3ExitConfigurationMode)
PLAIN(fmi3EvaluateDiscreteStates)
PLAIN(fmi3EnterContinuousTimeMode)
PLAIN(fmi3EnterStepMode)

/* ------------------------------------------------------------------------- values */

#define GETTER(name, type, HOW) \
    EXPORT fmi3Status name##type(fmi3Instance c, references vr[], size_t n, fmi3##type values[], size_t count) \
    { \
        return HOW(c, fmi3Get##type, IN(vr, n), NUMBER(n), OUT(values, count), NUMBER(count)); \
    }
#define SETTER(name, type, HOW) \
    EXPORT fmi3Status name##type(fmi3Instance c, references vr[], size_t n, const fmi3##type values[], size_t count) \
    { \
        return HOW(c, fmi3Set##type, IN(vr, n), NUMBER(n), IN(values, count), NUMBER(count)); \
    }
#define VALUES(type) \
    GETTER(fmi3Get, type, CALL) GETTER(loop_fmi3Get, type, GET) \
    SETTER(fmi3Set, type, CALL) SETTER(loop_fmi3Set, type, POST)
FMI3_TYPES(VALUES)

fmi3Status fmi3GetString(fmi3Instance c, references vr[], size_t n, fmi3String values[], size_t count)
{
    return CALL(c, fmi3GetString, IN(vr, n), NUMBER(n), OUT_TEXTS(values, count), NUMBER(count));
}

fmi3Status fmi3SetString(fmi3Instance c, references vr[], size_t n, const fmi3String values[], size_t count)
{
    return CALL(c, fmi3SetString, IN(vr, n), NUMBER(n), TEXTS(values, count), NUMBER(count));
}

fmi3Status fmi3GetBinary(fmi3Instance c, references vr[], size_t n, size_t sizes[], fmi3Binary values[], size_t count)
{
    return CALL(c, fmi3GetBinary, IN(vr, n), NUMBER(n), OUT(sizes, count), OUT_BLOBS(values, count), NUMBER(count));
}

fmi3Status fmi3SetBinary(fmi3Instance c, references vr[], size_t n, const size_t sizes[], const fmi3Binary values[],
                         size_t count)
{
    return CALL(c, fmi3SetBinary, IN(vr, n), NUMBER(n), IN(sizes, count), BLOBS(values, sizes, count), NUMBER(count));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, references unknowns[], size_t n_unknowns, references knowns[],
                                        size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                        fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    return CALL(c, fmi3GetDirectionalDerivative, IN(unknowns, n_unknowns), NUMBER(n_unknowns), IN(knowns, n_knowns),
                NUMBER(n_knowns), IN(seed, n_seed), NUMBER(n_seed), OUT(sensitivity, n_sensitivity),
                NUMBER(n_sensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, references unknowns[], size_t n_unknowns, references knowns[],
                                    size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                    fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    return CALL(c, fmi3GetAdjointDerivative, IN(unknowns, n_unknowns), NUMBER(n_unknowns), IN(knowns, n_knowns),
                NUMBER(n_knowns), IN(seed, n_seed), NUMBER(n_seed), OUT(sensitivity, n_sensitivity),
                NUMBER(n_sensitivity));
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, references vr[], size_t n, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t count)
{
    return CALL(c, fmi3GetOutputDerivatives, IN(vr, n), NUMBER(n), IN(orders, n), OUT(values, count), NUMBER(count));
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n)
{
    return CALL(c, fmi3GetNumberOfVariableDependencies, NUMBER(vr), OUT(n, 1));
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t independent_elements[],
                                       fmi3DependencyKind kinds[], size_t n)
{
    return CALL(c, fmi3GetVariableDependencies, NUMBER(dependent), OUT(elements, n), OUT(independents, n),
                OUT(independent_elements, n), OUT(kinds, n), NUMBER(n));
}

/* ------------------------------------------------------------------------- clocks */

fmi3Status fmi3GetClock(fmi3Instance c, references vr[], size_t n, fmi3Clock values[])
{
    return CALL(c, fmi3GetClock, IN(vr, n), NUMBER(n), OUT(values, n));
}

fmi3Status fmi3SetClock(fmi3Instance c, references vr[], size_t n, const fmi3Clock values[])
{
    return CALL(c, fmi3SetClock, IN(vr, n), NUMBER(n), IN(values, n));
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, references vr[], size_t n, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[])
{
    return CALL(c, fmi3GetIntervalDecimal, IN(vr, n), NUMBER(n), OUT(intervals, n), OUT(qualifiers, n));
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, references vr[], size_t n, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    return CALL(c, fmi3GetIntervalFraction, IN(vr, n), NUMBER(n), OUT(counters, n), OUT(resolutions, n),
                OUT(qualifiers, n));
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, references vr[], size_t n, fmi3Float64 shifts[])
{
    return CALL(c, fmi3GetShiftDecimal, IN(vr, n), NUMBER(n), OUT(shifts, n));
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, references vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[])
{
    return CALL(c, fmi3GetShiftFraction, IN(vr, n), NUMBER(n), OUT(counters, n), OUT(resolutions, n));
}

#define SET_DECIMAL(name) \
    fmi3Status name(fmi3Instance c, references vr[], size_t n, const fmi3Float64 values[]) \
    { \
        return CALL(c, name, IN(vr, n), NUMBER(n), IN(values, n)); \
    }
SET_DECIMAL(fmi3SetIntervalDecimal)
SET_DECIMAL(fmi3SetShiftDecimal)

#define SET_FRACTION(name) \
    fmi3Status name(fmi3Instance c, references vr[], size_t n, const fmi3UInt64 counters[], \
                    const fmi3UInt64 resolutions[]) \
    { \
        return CALL(c, name, IN(vr, n), NUMBER(n), IN(counters, n), IN(resolutions, n)); \
    }
SET_FRACTION(fmi3SetIntervalFraction)
SET_FRACTION(fmi3SetShiftFraction)

/* ------------------------------------- state: what is a pointer there is a number here */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return CALL(c, fmi3GetFMUState, OUT(state, 1));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return CALL(c, fmi3SetFMUState, HANDLE(state)); }

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return CALL(c, fmi3FreeFMUState, OUT(state, 1));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return CALL(c, fmi3SerializedFMUStateSize, HANDLE(state), OUT(size, 1));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return CALL(c, fmi3SerializeFMUState, HANDLE(state), OUT(bytes, size), NUMBER(size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return CALL(c, fmi3DeserializeFMUState, IN(bytes, size), NUMBER(size), OUT(state, 1));
}

/* ------------------------------------------------------- events and model exchange */

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *timed, fmi3Float64 *time)
{
    return CALL(c, fmi3UpdateDiscreteStates, OUT(again, 1), OUT(terminate, 1), OUT(nominals, 1), OUT(states, 1),
                OUT(timed, 1), OUT(time, 1));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set_before, fmi3Boolean *event,
                                       fmi3Boolean *terminate)
{
    return CALL(c, fmi3CompletedIntegratorStep, NUMBER(no_set_before), OUT(event, 1), OUT(terminate, 1));
}

#define SET_TIME(name, HOW) \
    EXPORT fmi3Status name(fmi3Instance c, fmi3Float64 time) \
    { \
        return HOW(caller_at(c, time, time), fmi3SetTime, REAL(time)); \
    }
SET_TIME(fmi3SetTime, CALL)
SET_TIME(loop_fmi3SetTime, POST)

#define SET_STATES(name, HOW) \
    EXPORT fmi3Status name(fmi3Instance c, const fmi3Float64 x[], size_t n) \
    { \
        return HOW(c, fmi3SetContinuousStates, IN(x, n), NUMBER(n)); \
    }
SET_STATES(fmi3SetContinuousStates, CALL)
SET_STATES(loop_fmi3SetContinuousStates, POST)

#define VECTOR(name) \
    fmi3Status name(fmi3Instance c, fmi3Float64 x[], size_t n) { return CALL(c, name, OUT(x, n), NUMBER(n)); }
VECTOR(fmi3GetContinuousStateDerivatives)
VECTOR(fmi3GetEventIndicators)
VECTOR(fmi3GetContinuousStates)
VECTOR(fmi3GetNominalsOfContinuousStates)

#define COUNT(name) \
    fmi3Status name(fmi3Instance c, size_t *n) { return CALL(c, name, OUT(n, 1)); }
COUNT(fmi3GetNumberOfEventIndicators)
COUNT(fmi3GetNumberOfContinuousStates)

/* ------------------------------------------------------------------ co-simulation */

#define DO_STEP(name, HOW) \
    EXPORT fmi3Status name(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set_before, \
                           fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) \
    { \
        return HOW(caller_at(c, t, t + h), fmi3DoStep, REAL(t), REAL(h), NUMBER(no_set_before), OUT(event, 1), \
                   OUT(terminate, 1), OUT(early, 1), OUT(last, 1)); \
    }
DO_STEP(fmi3DoStep, CALL)
DO_STEP(loop_fmi3DoStep, STEP)
