/* The host of an isolated FMU, which makes the calls that come through shared memory. */

#include "host.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

static struct channel *channel;
static size_t capacity;
static void *instance;

/* ------------------------------------------------------------------------- log */

/* An FMU may log from several threads. */
static atomic_flag logging = ATOMIC_FLAG_INIT;

static void write_line(int status, const char *category, const char *text)
{
    while (atomic_flag_test_and_set(&logging))
        ;
    const uint32_t n = atomic_load(&channel->logged);
    while (n - atomic_load(&channel->read) >= LOG_LINES) /* until the caller has read a line */
        channel_wake(&channel->answer);
    struct log_line *line = &channel->lines[n % LOG_LINES];
    line->status = status;
    snprintf(line->category, sizeof line->category, "%s", category != NULL ? category : "");
    snprintf(line->text, sizeof line->text, "%s", text != NULL ? text : "");
    atomic_store(&channel->logged, n + 1);
    atomic_flag_clear(&logging);
}

static void log2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String format, ...)
{
    (void)environment, (void)name;
    char text[LOG_TEXT];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format != NULL ? format : "", values);
    va_end(values);
    write_line((int)status, category, text);
}

static void log3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text)
{
    (void)environment;
    write_line((int)status, category, text);
}

/* -------------------------------------------------------------------- arguments */

/* Turn places in data into pointers: of arguments, and of the strings and binary data behind them. */
static void resolve(const struct call *call, uint64_t a[])
{
    for (int i = 0; i < call->n; i++) {
        const struct slot *s = &call->arguments[i];
        a[i] = s->kind == WORD || s->word == 0 ? s->word : (uintptr_t)(channel->data + s->word);
        uint64_t *places = (uint64_t *)(uintptr_t)a[i];
        for (uint32_t j = 0; s->kind == POINTERS && j < s->n; j++)
            places[j] = places[j] != 0 ? (uintptr_t)(channel->data + places[j]) : 0;
    }
}

/* Copy the strings or binary data of an argument into data, behind all arguments; return false if they
   do not fit. */
static bool bring_out(const struct slot *s, uint64_t *places, const size_t *sizes)
{
    for (uint32_t j = 0; places != NULL && j < s->n; j++) {
        const char *from = (const char *)(uintptr_t)places[j];
        if (from == NULL)
            continue;
        const size_t size = s->kind == TEXTS_OUT ? strlen(from) + 1 : sizes != NULL ? sizes[j] : 0;
        if (aligned(size) > capacity - channel->used)
            return false;
        memcpy(channel->data + channel->used, from, size);
        places[j] = channel->used;
        channel->used += aligned(size);
    }
    return true;
}

/* ------------------------------------------------------------------------ calls */

static int instantiated(void *made)
{
    instance = made;
    return made != NULL ? 0 : STATUS_ERROR;
}

/* Make or free the instance, or call another function of the FMU. */
static int call_fmu(enum function function, void *f, const uint64_t a[])
{
    static const fmi2CallbackFunctions callbacks = {log2, calloc, free, NULL, NULL};
    switch (function) {
    case F_fmi2Instantiate:
        return instantiated(((fmi2InstantiateTYPE *)f)(pointer(a[0]), (fmi2Type)a[1], pointer(a[2]), pointer(a[3]),
                                                       &callbacks, (int)a[4], (int)a[5]));
    case F_fmi3InstantiateModelExchange:
        return instantiated(((fmi3InstantiateModelExchangeTYPE *)f)(pointer(a[0]), pointer(a[1]), pointer(a[2]),
                                                                    (bool)a[3], (bool)a[4], NULL, log3));
    case F_fmi3InstantiateCoSimulation:
        return instantiated(((fmi3InstantiateCoSimulationTYPE *)f)(
            pointer(a[0]), pointer(a[1]), pointer(a[2]), (bool)a[3], (bool)a[4], (bool)a[5], (bool)a[6],
            pointer(a[7]), (size_t)a[8], NULL, log3, NULL));
    case F_fmi2FreeInstance:
    case F_fmi3FreeInstance:
        ((fmi2FreeInstanceTYPE *)f)(instance);
        return 0;
    default:
        return perform(function, f, instance, a);
    }
}

static int make(const struct call *call, void *f)
{
    uint64_t a[MAX_ARGUMENTS] = {0};
    if (f == NULL) {
        char text[120];
        snprintf(text, sizeof text, "the FMU's library has no function %s", function_name(call->function));
        write_line(STATUS_ERROR, "isolated", text);
        return STATUS_ERROR;
    }
    resolve(call, a);
    const int status = call_fmu(call->function, f, a);
    for (int i = 0; succeeded(status) && i < call->n; i++) {
        const struct slot *s = &call->arguments[i];
        if (s->kind != TEXTS_OUT && s->kind != BLOBS_OUT)
            continue;
        if (!bring_out(s, pointer(a[i]), s->kind == BLOBS_OUT ? pointer(a[i - 1]) : NULL)) {
            write_line(STATUS_ERROR, "isolated", "strings or binary data take more room than an isolated FMU has");
            return STATUS_ERROR;
        }
    }
    return status;
}

/* Report that the FMU is loaded, or the reason for its failure to load. */
EXPORT void host_ready(void *memory, size_t bytes, const char *failure)
{
    channel = memory;
    capacity = bytes - sizeof(struct channel);
    channel->calls[0].status = failure == NULL ? 0 : STATUS_ERROR;
    if (failure != NULL)
        snprintf((char *)channel->data, capacity, "%s", failure);
    channel_post(&channel->answer, 1, &channel->caller);
}

/* Make calls until a request is empty. `functions` are the FMU's functions in the order of functions.h;
   NULL stands for a function that the FMU does not have. */
EXPORT void host_serve(void *const functions[])
{
    for (uint32_t number = 2;; number++) {
        while (!channel_wait(&channel->request, number, &channel->host))
            ;
        if (channel->n == 0)
            return;
        int status = 0;
        for (int i = 0; i < channel->n && succeeded(status); i++) {
            struct call *call = &channel->calls[i];
            atomic_store_explicit(&channel->done, i + 1, memory_order_relaxed);
            status = call->status = make(call, functions[call->function]);
        }
        channel_post(&channel->answer, number, &channel->caller);
    }
}
