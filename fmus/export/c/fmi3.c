/* Co-Simulation and Model Exchange of FMI 3.0 over core.h: only the functions and types of this
   version. Variables are Float64, arrays as arrays. */

#include "core.h"

#include "fmi3Functions.h"

/* Return fmi3Error from a function that is not legal now; a NULL instance gets no log line. */
#define ENTER(operation)                                                                           \
    struct instance *self = c;                                                                     \
    if (!core_allows(self, operation, __func__)) return fmi3Error
#define DONE(call) return (fmi3Status)(call)
#define NEED(pointer, n)                                                                           \
    if (core_need(self, pointer, n, #pointer, __func__)) return fmi3Error
#define REFUSE(reason) DONE(core_refuse(self, __func__, reason))

static void sink(const struct instance *self, status s, const char *category, const char *message) {
    ((fmi3LogMessageCallback)self->logger)(self->environment, (fmi3Status)s, category, message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    ENTER(SET_LOGGING);
    DONE(core_set_logging(self, on, n, categories, __func__));
}

/* --- life cycle ----------------------------------------------------------------------------- */

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)resources, (void)visible;
    return core_new(name, token, MODEL_EXCHANGE, logging, sink, (void (*)(void))log, environment);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)n_intermediate, (void)update;
    struct instance *self =
        core_new(name, token, CO_SIMULATION, logging, sink, (void (*)(void))log, environment);
    if (self && event_mode) {
        self->log_errors = true; /* the NULL that follows gives no reason */
        core_refuse(self, __func__, "event mode is not supported (hasEventMode is false)");
        core_free(self);
        return NULL;
    }
    return self;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)resources, (void)visible, (void)clock, (void)lock, (void)unlock;
    return core_new(name, token, (enum interface)0, logging, sink, (void (*)(void))log, environment);
}

void fmi3FreeInstance(fmi3Instance c) { core_free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined, (void)tolerance;
    ENTER(PREPARE);
    if (core_prepare(self, start, stop_defined, stop, __func__)) return fmi3Error;
    DONE(core_enter_initialization(self));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    ENTER(EXIT_INITIALIZATION);
    DONE(core_exit_initialization(self, __func__));
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    ENTER(TERMINATE);
    DONE(core_terminate(self));
}

fmi3Status fmi3Reset(fmi3Instance c) {
    ENTER(RESET);
    DONE(core_reset(self));
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    ENTER(RESET);
    REFUSE("the FMU has no structural parameters to configure");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    ENTER(NEVER);
    return fmi3OK;
}

/* --- values --------------------------------------------------------------------------------- */

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t n_values) {
    ENTER(GET_VALUES);
    DONE(core_get(self, vr, n, values, n_values, true, __func__));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t n_values) {
    ENTER(SET_VALUES);
    DONE(core_set(self, vr, n, values, n_values, true, __func__));
}

/* All variables are Float64: functions of other types accept only empty calls. */
#define NOTHING(operation)                                                                         \
    (void)vr, (void)values, (void)n_values;                                                        \
    ENTER(operation);                                                                              \
    if (n == 0) return fmi3OK;                                                                     \
    REFUSE("unknown value reference: all variables are Float64")
#define NO_VARIABLES(type, get, set)                                                               \
    fmi3Status get(fmi3Instance c, const fmi3ValueReference vr[], size_t n, type values[],         \
                   size_t n_values) {                                                              \
        NOTHING(GET_VALUES);                                                                       \
    }                                                                                              \
    fmi3Status set(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const type values[],   \
                   size_t n_values) {                                                              \
        NOTHING(SET_VALUES);                                                                       \
    }

NO_VARIABLES(fmi3Float32, fmi3GetFloat32, fmi3SetFloat32)
NO_VARIABLES(fmi3Int8, fmi3GetInt8, fmi3SetInt8)
NO_VARIABLES(fmi3UInt8, fmi3GetUInt8, fmi3SetUInt8)
NO_VARIABLES(fmi3Int16, fmi3GetInt16, fmi3SetInt16)
NO_VARIABLES(fmi3UInt16, fmi3GetUInt16, fmi3SetUInt16)
NO_VARIABLES(fmi3Int32, fmi3GetInt32, fmi3SetInt32)
NO_VARIABLES(fmi3UInt32, fmi3GetUInt32, fmi3SetUInt32)
NO_VARIABLES(fmi3Int64, fmi3GetInt64, fmi3SetInt64)
NO_VARIABLES(fmi3UInt64, fmi3GetUInt64, fmi3SetUInt64)
NO_VARIABLES(fmi3Boolean, fmi3GetBoolean, fmi3SetBoolean)
NO_VARIABLES(fmi3String, fmi3GetString, fmi3SetString)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t n_values) {
    (void)sizes;
    NOTHING(GET_VALUES);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values) {
    (void)sizes;
    NOTHING(SET_VALUES);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
    (void)vr, (void)n;
    ENTER(GET_SNAPSHOT);
    REFUSE("dependencies are in modelDescription.xml (providesPerElementDependencies is false)");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t dependent[],
                                       fmi3ValueReference independents[], size_t independent[],
                                       fmi3DependencyKind kinds[], size_t n) {
    (void)vr, (void)dependent, (void)independents, (void)independent, (void)kinds, (void)n;
    ENTER(GET_SNAPSHOT);
    REFUSE("dependencies are in modelDescription.xml (providesPerElementDependencies is false)");
}

/* --- snapshots and derivatives -------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    ENTER(GET_SNAPSHOT);
    DONE(core_snapshot(self, state, __func__));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    ENTER(SET_SNAPSHOT);
    DONE(core_restore(self, state, __func__));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    ENTER(FREE_SNAPSHOT);
    if (state) core_forget(state);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    ENTER(GET_SNAPSHOT);
    NEED(state, 1);
    NEED(size, 1);
    *size = core_serialized_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    ENTER(GET_SNAPSHOT);
    DONE(core_serialize(self, state, bytes, size, __func__));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    ENTER(GET_SNAPSHOT);
    DONE(core_deserialize(self, bytes, size, state, __func__));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns,
                                        const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
                                        size_t n_sensitivity) {
    ENTER(DIFFERENTIATE);
    DONE(core_differentiate(self, (struct direction){unknowns, n_unknowns, n_sensitivity},
                            (struct direction){knowns, n_knowns, n_seed}, true, seed, sensitivity, __func__));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns;
    (void)seed, (void)n_seed, (void)sensitivity, (void)n_sensitivity;
    ENTER(DIFFERENTIATE);
    REFUSE("adjoint derivatives are not supported (providesAdjointDerivatives is false)");
}

/* --- events: the model has none ------------------------------------------------------------- */

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    ENTER(ENTER_EVENT);
    self->mode = EVENT;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needUpdate, fmi3Boolean *terminate,
                                    fmi3Boolean *nominalsChanged, fmi3Boolean *statesChanged,
                                    fmi3Boolean *eventTimeDefined, fmi3Float64 *eventTime) {
    ENTER(UPDATE_DISCRETE);
    fmi3Boolean *const answers[] = {needUpdate, terminate, nominalsChanged, statesChanged, eventTimeDefined};
    NEED(eventTime, 1);
    for (int i = 0; i < 5; i++) NEED(answers[i], 1);
    for (int i = 0; i < 5; i++) *answers[i] = fmi3False;
    *eventTime = 0.0;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    ENTER(EVALUATE_DISCRETE);
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    ENTER(NEVER);
    return fmi3OK;
}

#define NO_CLOCKS(...)                                                                             \
    (void)vr, (void)n;                                                                             \
    __VA_ARGS__;                                                                                   \
    ENTER(GET_SNAPSHOT);                                                                           \
    REFUSE("the FMU has no clocks")

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock values[]) {
    NO_CLOCKS((void)values);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[]) {
    NO_CLOCKS((void)values);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    NO_CLOCKS((void)intervals, (void)qualifiers);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    NO_CLOCKS((void)counters, (void)resolutions, (void)qualifiers);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
    NO_CLOCKS((void)shifts);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    NO_CLOCKS((void)counters, (void)resolutions);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                  const fmi3Float64 intervals[]) {
    NO_CLOCKS((void)intervals);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    NO_CLOCKS((void)counters, (void)resolutions);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                               const fmi3Float64 shifts[]) {
    NO_CLOCKS((void)shifts);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    NO_CLOCKS((void)counters, (void)resolutions);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock, (void)time;
    ENTER(GET_SNAPSHOT);
    REFUSE("the FMU has no clocks");
}

/* --- Model Exchange ------------------------------------------------------------------------- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    ENTER(ENTER_CONTINUOUS_TIME);
    self->mode = CONTINUOUS_TIME;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_restore, fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    (void)no_restore;
    ENTER(COMPLETE_STEP);
    NEED(enterEventMode, 1);
    NEED(terminateSimulation, 1);
    *enterEventMode = *terminateSimulation = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    ENTER(SET_TIME);
    DONE(core_set_time(self, time, __func__));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
    ENTER(SET_STATES);
    DONE(core_set_states(self, x, n, __func__));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    ENTER(GET_STATES);
    DONE(core_get_zone(self, STATE, x, n, __func__));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) {
    ENTER(GET_DERIVATIVES);
    DONE(core_get_zone(self, DERIVATIVE, x, n, __func__));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    ENTER(GET_STATES);
    if (core_get_zone(self, STATE, x, n, __func__)) return fmi3Error; /* checks x and n */
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) {
    (void)z;
    ENTER(GET_DERIVATIVES);
    if (n == 0) return fmi3OK;
    DONE(core_refuse(self, __func__, "%zu values for 0 event indicators", n));
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    ENTER(GET_SNAPSHOT);
    NEED(n, 1);
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    ENTER(GET_SNAPSHOT);
    NEED(n, 1);
    *n = model.zone[STATE + 1] - model.zone[STATE];
    return fmi3OK;
}

/* --- Co-Simulation -------------------------------------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_restore,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    (void)no_restore;
    ENTER(DO_STEP);
    NEED(eventHandlingNeeded, 1);
    NEED(terminateSimulation, 1);
    NEED(earlyReturn, 1);
    NEED(lastSuccessfulTime, 1);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = self->t;
    if (core_step(self, t, h, __func__)) return fmi3Error;
    *lastSuccessfulTime = self->t;
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values) {
    (void)vr, (void)orders, (void)values, (void)n_values;
    ENTER(GET_VALUES);
    if (n == 0) return fmi3OK;
    REFUSE("outputs have no derivatives (maxOutputDerivativeOrder = 0)");
}
