/* FMI 2.0 of an isolated FMU: fmi2Functions.h says what the functions do. */

#include "caller.h"

#include <string.h>

#include "fmi2Functions.h"

typedef const fmi2ValueReference references;

/* ----------------------------------------------------------------------- instance */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static void pass_on(struct remote *r, int status, const char *category, const char *text)
{
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)caller_log_function(r);
    if (logger != NULL)
        logger(caller_environment(r), "", (fmi2Status)status, category, "%s", text);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    struct remote *r = caller_begin(pass_on, functions->componentEnvironment, (void *)functions->logger);
    if (r == NULL)
        return NULL;
    const int status = CALL(r, fmi2Instantiate, TEXT(name), NUMBER(type), TEXT(guid), TEXT(resources),
                            NUMBER(visible), NUMBER(logging));
    return status == 0 ? r : NULL;
}

void fmi2FreeInstance(fmi2Component c) { CALL_PLAIN(c, fmi2FreeInstance); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    return CALL(c, fmi2SetDebugLogging, NUMBER(on), NUMBER(n), TEXTS(categories, n));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    return CALL(caller_at(c, start, start), fmi2SetupExperiment, NUMBER(tolerance_defined), REAL(tolerance), REAL(start),
                NUMBER(stop_defined), REAL(stop));
}

#define PLAIN(name) \
    fmi2Status name(fmi2Component c) { return CALL_PLAIN(c, name); }
PLAIN(fmi2EnterInitializationMode)
PLAIN(fmi2ExitInitializationMode)
PLAIN(fmi2Terminate)
PLAIN(fmi2Reset)
PLAIN(fmi2EnterEventMode)
PLAIN(fmi2EnterContinuousTimeMode)
PLAIN(fmi2CancelStep)

/* ------------------------------------------------------------------------- values */

#define GETTER(name, type, HOW) \
    EXPORT fmi2Status name##type(fmi2Component c, references vr[], size_t n, fmi2##type value[]) \
    { \
        return HOW(c, fmi2Get##type, IN(vr, n), NUMBER(n), OUT(value, n)); \
    }
#define SETTER(name, type, HOW) \
    EXPORT fmi2Status name##type(fmi2Component c, references vr[], size_t n, const fmi2##type value[]) \
    { \
        return HOW(c, fmi2Set##type, IN(vr, n), NUMBER(n), IN(value, n)); \
    }
#define VALUES(type) \
    GETTER(fmi2Get, type, CALL) GETTER(loop_fmi2Get, type, GET) \
    SETTER(fmi2Set, type, CALL) SETTER(loop_fmi2Set, type, POST)
VALUES(Real)
VALUES(Integer)
VALUES(Boolean)

fmi2Status fmi2GetString(fmi2Component c, references vr[], size_t n, fmi2String value[])
{
    return CALL(c, fmi2GetString, IN(vr, n), NUMBER(n), OUT_TEXTS(value, n));
}

fmi2Status fmi2SetString(fmi2Component c, references vr[], size_t n, const fmi2String value[])
{
    return CALL(c, fmi2SetString, IN(vr, n), NUMBER(n), TEXTS(value, n));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, references unknowns[], size_t n_unknowns,
                                        references knowns[], size_t n_knowns, const fmi2Real known[],
                                        fmi2Real unknown[])
{
    return CALL(c, fmi2GetDirectionalDerivative, IN(unknowns, n_unknowns), NUMBER(n_unknowns), IN(knowns, n_knowns),
                NUMBER(n_knowns), IN(known, n_knowns), OUT(unknown, n_unknowns));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, references vr[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[])
{
    return CALL(c, fmi2SetRealInputDerivatives, IN(vr, n), NUMBER(n), IN(order, n), IN(value, n));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, references vr[], size_t n, const fmi2Integer order[],
                                        fmi2Real value[])
{
    return CALL(c, fmi2GetRealOutputDerivatives, IN(vr, n), NUMBER(n), IN(order, n), OUT(value, n));
}

/* ------------------------------------- state: what is a pointer there is a number here */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return CALL(c, fmi2GetFMUstate, OUT(state, 1));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return CALL(c, fmi2SetFMUstate, HANDLE(state)); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return CALL(c, fmi2FreeFMUstate, OUT(state, 1));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return CALL(c, fmi2SerializedFMUstateSize, HANDLE(state), OUT(size, 1));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return CALL(c, fmi2SerializeFMUstate, HANDLE(state), OUT(bytes, size), NUMBER(size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return CALL(c, fmi2DeSerializeFMUstate, IN(bytes, size), NUMBER(size), OUT(state, 1));
}

/* ----------------------------------------------------------------- model exchange */

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    return CALL(c, fmi2NewDiscreteStates, OUT(info, 1));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_before, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    return CALL(c, fmi2CompletedIntegratorStep, NUMBER(no_set_before), OUT(event, 1), OUT(terminate, 1));
}

#define SET_TIME(name, HOW) \
    EXPORT fmi2Status name(fmi2Component c, fmi2Real time) { return HOW(caller_at(c, time, time), fmi2SetTime, REAL(time)); }
SET_TIME(fmi2SetTime, CALL)
SET_TIME(loop_fmi2SetTime, POST)

#define SET_STATES(name, HOW) \
    EXPORT fmi2Status name(fmi2Component c, const fmi2Real x[], size_t n) \
    { \
        return HOW(c, fmi2SetContinuousStates, IN(x, n), NUMBER(n)); \
    }
SET_STATES(fmi2SetContinuousStates, CALL)
SET_STATES(loop_fmi2SetContinuousStates, POST)

#define VECTOR(name) \
    fmi2Status name(fmi2Component c, fmi2Real x[], size_t n) { return CALL(c, name, OUT(x, n), NUMBER(n)); }
VECTOR(fmi2GetDerivatives)
VECTOR(fmi2GetEventIndicators)
VECTOR(fmi2GetContinuousStates)
VECTOR(fmi2GetNominalsOfContinuousStates)

/* ------------------------------------------------------------------ co-simulation */

#define DO_STEP(name, HOW) \
    EXPORT fmi2Status name(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set_before) \
    { \
        return HOW(caller_at(c, t, t + h), fmi2DoStep, REAL(t), REAL(h), NUMBER(no_set_before)); \
    }
DO_STEP(fmi2DoStep, CALL)
DO_STEP(loop_fmi2DoStep, STEP)

#define STATUS(name, type) \
    fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value) \
    { \
        return CALL(c, name, NUMBER(kind), OUT(value, 1)); \
    }
STATUS(fmi2GetStatus, fmi2Status)
STATUS(fmi2GetRealStatus, fmi2Real)
STATUS(fmi2GetIntegerStatus, fmi2Integer)
STATUS(fmi2GetBooleanStatus, fmi2Boolean)

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    return CALL(c, fmi2GetStringStatus, NUMBER(kind), OUT_TEXTS(value, 1));
}
