/* The functions of FMI that make and free the instance of an isolated FMU, and the unsupported ones.
   All others are generated from the table in functions.py. */

#include "caller.h"

#include <string.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

static const char NO_SCHEDULED_EXECUTION[] = "an isolated FMU cannot run in Scheduled Execution";

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
const char *fmi3GetVersion(void) { return fmi3Version; }

static void log_2(void *logger, void *environment, int status, const char *category, const char *text)
{
    ((fmi2CallbackLogger)logger)(environment, "", (fmi2Status)status, category, "%s", text);
}

static void log_3(void *logger, void *environment, int status, const char *category, const char *text)
{
    ((fmi3LogMessageCallback)logger)(environment, (fmi3Status)status, category, text);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    if (functions == NULL)
        return NULL;
    struct remote *r = caller_begin(log_2, functions->componentEnvironment, (void *)functions->logger);
    return CALL(r, fmi2Instantiate, TEXT(name), NUMBER(type), TEXT(guid), TEXT(resources), NUMBER(visible),
                NUMBER(logging)) == 0 ? r : NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    struct remote *r = caller_begin(log_3, environment, (void *)log);
    return CALL(r, fmi3InstantiateModelExchange, TEXT(name), TEXT(token), TEXT(resources), NUMBER(visible),
                NUMBER(logging)) == 0 ? r : NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
                                         fmi3Boolean early, const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    struct remote *r = caller_begin(log_3, environment, (void *)log);
    if (update != NULL) {
        caller_say(r, "an isolated FMU cannot call back for intermediate updates");
        return NULL;
    }
    return CALL(r, fmi3InstantiateCoSimulation, TEXT(name), TEXT(token), TEXT(resources), NUMBER(visible),
                NUMBER(logging), NUMBER(events), NUMBER(early), IN(required, n), NUMBER(n)) == 0 ? r : NULL;
}

/* Scheduled Execution calls back into the importer at any moment, which the channel cannot do. */
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    caller_say(caller_begin(log_3, environment, (void *)log), NO_SCHEDULED_EXECUTION);
    return NULL;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    caller_say(c, NO_SCHEDULED_EXECUTION);
    return fmi3Error;
}

void fmi2FreeInstance(fmi2Component c) { caller_call(c, F_fmi2FreeInstance, NULL, 0); }
void fmi3FreeInstance(fmi3Instance c) { caller_call(c, F_fmi3FreeInstance, NULL, 0); }
