/* Co-Simulation and Model Exchange of FMI 2.0 over core.h: only the functions and types of this
   version. */

#include "core.h"

#include <string.h>

#include "fmi2Functions.h"

/* Return fmi2Error from a function that is not legal now; a NULL component gets no log line. */
#define ENTER(operation)                                                                           \
    struct instance *self = c;                                                                     \
    if (!core_allows(self, operation, __func__)) return fmi2Error
#define DONE(call) return (fmi2Status)(call)
#define NEED(pointer, n)                                                                           \
    if (core_need(self, pointer, n, #pointer, __func__)) return fmi2Error

/* FMI 2.0 loggers take a format: double every per cent sign. */
static void sink(const struct instance *self, status s, const char *category, const char *message) {
    char format[1024];
    size_t k = 0;
    for (; *message && k + 2 < sizeof format; message++) {
        if (*message == '%') format[k++] = '%';
        format[k++] = *message;
    }
    format[k] = '\0';
    ((fmi2CallbackLogger)self->logger)(self->environment, self->name, (fmi2Status)s, category, format);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    ENTER(SET_LOGGING);
    DONE(core_set_logging(self, on != fmi2False, n, categories, __func__));
}

/* --- life cycle ----------------------------------------------------------------------------- */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible;
    if (!functions) return NULL;
    enum interface interface = type == fmi2ModelExchange ? MODEL_EXCHANGE
                               : type == fmi2CoSimulation ? CO_SIMULATION : (enum interface)0;
    return core_new(name, guid, interface, logging != fmi2False, sink, (void (*)(void))functions->logger,
                    functions->componentEnvironment);
}

void fmi2FreeInstance(fmi2Component c) { core_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    (void)tolerance_defined, (void)tolerance;
    ENTER(PREPARE);
    DONE(core_prepare(self, start, stop_defined != fmi2False, stop, __func__));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ENTER(ENTER_INITIALIZATION);
    DONE(core_enter_initialization(self));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ENTER(EXIT_INITIALIZATION);
    DONE(core_exit_initialization(self, __func__));
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ENTER(TERMINATE);
    DONE(core_terminate(self));
}

fmi2Status fmi2Reset(fmi2Component c) {
    ENTER(RESET);
    DONE(core_reset(self));
}

/* --- values --------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    ENTER(GET_VALUES);
    DONE(core_get(self, vr, n, value, n, false, __func__));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    ENTER(SET_VALUES);
    DONE(core_set(self, vr, n, value, n, false, __func__));
}

/* All variables are Real: functions of other types accept only empty calls. */
#define NO_VARIABLES(type, get, set)                                                               \
    fmi2Status get(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) {       \
        (void)vr, (void)value;                                                                     \
        ENTER(GET_VALUES);                                                                         \
        if (n == 0) return fmi2OK;                                                                 \
        DONE(core_refuse(self, __func__, "unknown value reference: all variables are Real"));      \
    }                                                                                              \
    fmi2Status set(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]) { \
        (void)vr, (void)value;                                                                     \
        ENTER(SET_VALUES);                                                                         \
        if (n == 0) return fmi2OK;                                                                 \
        DONE(core_refuse(self, __func__, "unknown value reference: all variables are Real"));      \
    }

NO_VARIABLES(fmi2Integer, fmi2GetInteger, fmi2SetInteger)
NO_VARIABLES(fmi2Boolean, fmi2GetBoolean, fmi2SetBoolean)
NO_VARIABLES(fmi2String, fmi2GetString, fmi2SetString)

/* --- snapshots ------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ENTER(GET_SNAPSHOT);
    DONE(core_snapshot(self, state, __func__));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    ENTER(SET_SNAPSHOT);
    DONE(core_restore(self, state, __func__));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ENTER(FREE_SNAPSHOT);
    if (state) core_forget(state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    ENTER(GET_SNAPSHOT);
    NEED(state, 1);
    NEED(size, 1);
    *size = core_serialized_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    ENTER(GET_SNAPSHOT);
    DONE(core_serialize(self, state, (unsigned char *)bytes, size, __func__));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    ENTER(GET_SNAPSHOT);
    DONE(core_deserialize(self, (const unsigned char *)bytes, size, state, __func__));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known,
                                        const fmi2Real seed[], fmi2Real result[]) {
    ENTER(DIFFERENTIATE);
    DONE(core_differentiate(self, (struct direction){unknown, n_unknown, n_unknown},
                            (struct direction){known, n_known, n_known}, false, seed, result, __func__));
}

/* --- Model Exchange ------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    ENTER(ENTER_EVENT);
    self->mode = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    ENTER(UPDATE_DISCRETE);
    NEED(info, 1);
    memset(info, 0, sizeof *info); /* no events, no discrete states: every answer is fmi2False */
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    ENTER(ENTER_CONTINUOUS_TIME);
    self->mode = CONTINUOUS_TIME;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_restore, fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    (void)no_restore;
    ENTER(COMPLETE_STEP);
    NEED(enterEventMode, 1);
    NEED(terminateSimulation, 1);
    *enterEventMode = *terminateSimulation = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    ENTER(SET_TIME);
    DONE(core_set_time(self, time, __func__));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    ENTER(SET_STATES);
    DONE(core_set_states(self, x, n, __func__));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    ENTER(GET_STATES);
    DONE(core_get_zone(self, STATE, x, n, __func__));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) {
    ENTER(GET_DERIVATIVES);
    DONE(core_get_zone(self, DERIVATIVE, x, n, __func__));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    ENTER(GET_STATES);
    if (core_get_zone(self, STATE, x, n, __func__)) return fmi2Error; /* checks x and n */
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    (void)z;
    ENTER(GET_DERIVATIVES);
    if (n == 0) return fmi2OK;
    DONE(core_refuse(self, __func__, "%zu values for 0 event indicators", n));
}

/* --- Co-Simulation -------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_restore) {
    (void)no_restore;
    ENTER(DO_STEP);
    DONE(core_step(self, t, h, __func__));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    ENTER(DO_STEP);
    DONE(core_refuse(self, __func__, "no step is pending: steps are synchronous"));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)order, (void)value;
    ENTER(SET_VALUES);
    if (n == 0) return fmi2OK;
    DONE(core_refuse(self, __func__, "inputs are held over a step, not interpolated"));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)order, (void)value;
    ENTER(GET_VALUES);
    if (n == 0) return fmi2OK;
    DONE(core_refuse(self, __func__, "outputs have no derivatives (maxOutputDerivativeOrder = 0)"));
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(STEP_STATUS);
    NEED(value, 1);
    if (kind != fmi2LastSuccessfulTime) DONE(core_refuse(self, __func__, "status %d is not a Real", (int)kind));
    *value = self->t;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    ENTER(STEP_STATUS);
    NEED(value, 1);
    if (kind != fmi2Terminated) DONE(core_refuse(self, __func__, "status %d is not a Boolean", (int)kind));
    *value = fmi2False;
    return fmi2OK;
}

/* The other kinds of status belong to a pending step, and steps are synchronous. */
#define NO_STATUS(type, get)                                                                       \
    fmi2Status get(fmi2Component c, const fmi2StatusKind kind, type *value) {                      \
        (void)value;                                                                               \
        ENTER(STEP_STATUS);                                                                        \
        DONE(core_refuse(self, __func__, "no step is pending (status %d)", (int)kind));            \
    }

NO_STATUS(fmi2Status, fmi2GetStatus)
NO_STATUS(fmi2Integer, fmi2GetIntegerStatus)
NO_STATUS(fmi2String, fmi2GetStringStatus)
