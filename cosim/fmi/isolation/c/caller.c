#include "caller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_FOLLOWING = 8, MAX_GET_ARGUMENTS = 4 };

/* A get that follows every step of the loop; `index` is the number of its call in the last request, or -1. */
struct following {
    enum function function;
    struct argument arguments[MAX_GET_ARGUMENTS];
    int n, index;
};

struct remote {
    struct channel *channel;
    size_t capacity;                           /* bytes of channel->data */
    int32_t (*check)(int64_t, double, double); /* 0 to go on waiting; otherwise a crash, or Ctrl-C */
    bool ended;
    uint32_t number;              /* of the last request */
    int waiting, sent;            /* numbers of calls not sent yet, and of calls in the last request */
    size_t used;                  /* bytes of channel->data that their arguments occupy */
    struct call calls[MAX_CALLS]; /* the packed calls, out of the host's reach */
    double begin, end;            /* of the last step, or the time that was set */
    struct following following[MAX_FOLLOWING];
    int n_following;
    caller_log *log;
    void *environment, *logger;
};

static _Thread_local struct remote *next;

/* ------------------------------------------------------------------ from Python */

EXPORT struct remote *caller_open(void *memory, size_t bytes, int32_t (*check)(int64_t, double, double))
{
    struct remote *r = calloc(1, sizeof *r);
    if (r == NULL)
        return NULL;
    r->channel = memory;
    r->capacity = bytes - sizeof(struct channel);
    r->check = check;
    r->begin = r->end = NAN;
    return next = r;
}

EXPORT void caller_close(struct remote *r) { free(r); }

/* Return the number of calls of the last request that were made, a failed and the present one included. */
static int made(struct remote *r)
{
    const int done = atomic_load(&r->channel->done);
    return done < 0 ? 0 : done > r->sent ? r->sent : done;
}

/* Return the status of a call of the last request; a status that FMI does not define is an error. */
static int status_of(const struct remote *r, int index)
{
    const int status = index >= 0 ? r->channel->calls[index].status : STATUS_FATAL;
    return status >= 0 && status <= STATUS_PENDING ? status : STATUS_ERROR;
}

/* Return the function that the host is calling or called last; -1 before its first call. */
EXPORT int caller_function(struct remote *r)
{
    const int done = made(r);
    return done > 0 ? r->calls[done - 1].function : -1;
}

/* Return the time of that call: the beginning of the step if it is a step or follows one in the same
   request, otherwise the end. */
EXPORT double caller_time(struct remote *r)
{
    for (int i = made(r) - 1; i >= 0 && i < r->sent; i++)
        if (r->calls[i].function == F_fmi2DoStep || r->calls[i].function == F_fmi3DoStep)
            return r->begin;
    return r->end;
}

/* ------------------------------------------------------------------------- log */

static void pass_on(const struct remote *r, int status, const char *category, const char *text)
{
    if (r != NULL && r->logger != NULL)
        r->log(r->logger, r->environment, status, category, text);
}

void caller_say(struct remote *r, const char *text) { pass_on(r, STATUS_ERROR, "isolated", text); }

static void pass_on_log(struct remote *r)
{
    struct channel *c = r->channel;
    while (atomic_load(&c->read) != atomic_load(&c->logged)) {
        struct log_line *line = &c->lines[atomic_load(&c->read) % LOG_LINES];
        line->category[sizeof line->category - 1] = line->text[sizeof line->text - 1] = '\0';
        pass_on(r, line->status, line->category, line->text);
        atomic_fetch_add(&c->read, 1);
    }
}

/* --------------------------------------------------------------------- requests */

static bool answered(struct remote *r)
{
    struct channel *c = r->channel;
    while (!channel_wait(&c->answer, r->number, &c->caller)) {
        pass_on_log(r);
        if (r->check(0, r->end, 0.0) != 0) {
            pass_on_log(r); /* the last lines before the end */
            r->ended = true;
            return false;
        }
    }
    pass_on_log(r);
    return true;
}

/* Send the waiting calls; return the status of the last one that was made, which is the failed one if
   any failed: the host stops there. */
static int send(struct remote *r)
{
    struct channel *c = r->channel;
    for (int i = 0; i < r->n_following; i++)
        r->following[i].index = -1;
    c->n = r->sent = r->waiting;
    c->used = r->used;
    r->waiting = 0;
    channel_post(&c->request, ++r->number, &c->host);
    return answered(r) ? status_of(r, made(r) - 1) : STATUS_FATAL;
}

/* Wait until the host has loaded the FMU; return 0, or another number if it could not. */
EXPORT int caller_await(struct remote *r)
{
    r->number = 1;
    return answered(r) ? r->channel->calls[0].status : STATUS_FATAL;
}

/* Return the reason for its failure. */
EXPORT const char *caller_reason(struct remote *r)
{
    r->channel->data[r->capacity - 1] = '\0';
    return (const char *)r->channel->data;
}

/* Ask the host to end, without waiting for it; return false if it has ended or does not respond. */
EXPORT bool caller_stop(struct remote *r)
{
    if (r->ended)
        return false;
    r->ended = true;
    r->channel->n = 0;
    channel_post(&r->channel->request, ++r->number, &r->channel->host);
    return true;
}

/* -------------------------------------------------------------------- arguments */

static size_t size_of(const struct argument *a, size_t i)
{
    const char *const *texts = a->values;
    return texts[i] == NULL ? 0 : a->sizes != NULL ? a->sizes[i] : strlen(texts[i]) + 1;
}

static size_t room(const struct argument *a)
{
    if (a->kind == WORD || a->values == NULL)
        return 0;
    if (a->kind == BLOCK)
        return aligned(a->n * a->size);
    size_t bytes = aligned(8 * a->n);
    for (size_t i = 0; a->kind == POINTERS && i < a->n; i++)
        bytes += aligned(size_of(a, i));
    return bytes;
}

/* Write an argument to data from `used` on. A block that comes out goes in as well, since a function
   that fails may leave it as it was. */
static struct slot packed(unsigned char *data, size_t used, const struct argument *a)
{
    if (a->kind == WORD)
        return (struct slot){WORD, 0, a->word};
    if (a->values == NULL)
        return (struct slot){a->kind, 0, 0};
    if (a->kind == BLOCK)
        memcpy(data + used, a->values, a->n * a->size);
    if (a->kind == TEXTS_OUT || a->kind == BLOBS_OUT)
        memset(data + used, 0, 8 * a->n);
    const void *const *values = a->values;
    uint64_t *places = (uint64_t *)(data + used);
    size_t at = used + aligned(8 * a->n);
    for (size_t i = 0; a->kind == POINTERS && i < a->n; i++) {
        const size_t size = size_of(a, i);
        places[i] = values[i] != NULL ? at : 0;
        if (values[i] != NULL)
            memcpy(data + at, values[i], size);
        at += aligned(size);
    }
    return (struct slot){a->kind, (uint32_t)a->n, used};
}

/* Copy an output block back; strings and binary data stay in the channel until the next call. */
static void unpack(const struct remote *r, const struct argument *a, const struct slot *s, bool failed)
{
    unsigned char *data = r->channel->data;
    if (!a->out || a->values == NULL)
        return;
    if (a->kind == BLOCK) {
        memcpy((void *)a->values, data + s->word, a->n * a->size);
        return;
    }
    data[r->capacity - 1] = '\0'; /* every string ends */
    const uint64_t *places = (const uint64_t *)(data + s->word);
    for (size_t i = 0; !failed && i < a->n; i++)
        ((const void **)a->values)[i] = places[i] != 0 && places[i] < r->capacity ? data + places[i] : NULL;
}

/* ------------------------------------------------------------------------ calls */

/* Add a call to the next request; return its index, or minus the status of a failure: the call does not
   fit, or those that had to be sent before it failed. */
static int add(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    size_t bytes = 0;
    for (int i = 0; i < n; i++)
        bytes += room(&arguments[i]);
    if (r->waiting == 0)
        r->used = 16; /* place 0 is NULL */
    if (r->waiting == MAX_CALLS || bytes > r->capacity - r->used) {
        if (r->waiting != 0) {
            const int status = send(r);
            return succeeded(status) ? add(r, function, arguments, n) : -status;
        }
        char text[120];
        snprintf(text, sizeof text, "%s passes more than the %zu MB that an isolated FMU has room for",
                 function_name(function), r->capacity >> 20);
        caller_say(r, text);
        return -STATUS_ERROR;
    }
    struct call *call = &r->calls[r->waiting];
    call->function = function;
    call->n = n;
    for (int i = 0; i < n; i++) {
        call->arguments[i] = packed(r->channel->data, r->used, &arguments[i]);
        r->used += room(&arguments[i]);
    }
    struct call *shared = &r->channel->calls[r->waiting];
    memcpy(shared, call, offsetof(struct call, arguments) + (size_t)n * sizeof call->arguments[0]);
    return r->waiting++;
}

/* Take over the results of a call of the last request; return its status, or that of an earlier call
   that failed. */
static int take(struct remote *r, int index, const struct argument *arguments)
{
    if (index >= made(r))
        return status_of(r, made(r) - 1);
    const struct call *call = &r->calls[index];
    const int status = status_of(r, index);
    for (int i = 0; i < call->n; i++)
        unpack(r, &arguments[i], &call->arguments[i], !succeeded(status));
    return status;
}

/* Return the status of a call that cannot be made, or 0. */
static int refused(const struct remote *r) { return r == NULL ? STATUS_ERROR : r->ended ? STATUS_FATAL : 0; }

int caller_call(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (refused(r))
        return refused(r);
    const int index = add(r, function, arguments, n);
    if (index < 0)
        return -index;
    send(r);
    return r->ended ? STATUS_FATAL : take(r, index, arguments);
}

int caller_post(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (refused(r))
        return refused(r);
    const int index = add(r, function, arguments, n);
    return index < 0 ? -index : 0;
}

int caller_step(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (refused(r))
        return refused(r);
    int indices[MAX_FOLLOWING];
    if (r->waiting + 1 + r->n_following > MAX_CALLS)
        r->n_following = 0;
    const int index = add(r, function, arguments, n);
    if (index < 0)
        return -index;
    for (int i = 0; i < r->n_following; i++)
        indices[i] = add(r, r->following[i].function, r->following[i].arguments, r->following[i].n);
    send(r);
    if (r->ended)
        return STATUS_FATAL;
    for (int i = 0; i < r->n_following; i++)
        r->following[i].index = indices[i] < made(r) ? indices[i] : -1;
    return take(r, index, arguments);
}

static bool is_same(const struct argument *a, const struct argument *b, int n)
{
    for (int i = 0; i < n; i++)
        if (a[i].values != b[i].values || a[i].n != b[i].n || a[i].word != b[i].word)
            return false;
    return true;
}

int caller_get(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (refused(r))
        return refused(r);
    struct following *f = r->following, *const end = f + r->n_following;
    while (f < end && (f->function != function || !is_same(f->arguments, arguments, n)))
        f++;
    if (f < end && f->index >= 0 && r->waiting == 0)
        return take(r, f->index, arguments);
    if (f == end && r->n_following < MAX_FOLLOWING) {
        *f = (struct following){.function = function, .n = n, .index = -1};
        memcpy(f->arguments, arguments, (size_t)n * sizeof *arguments);
        r->n_following++;
    }
    return caller_call(r, function, arguments, n);
}

/* -------------------------------------------------------------------- instances */

struct remote *caller_at(struct remote *r, double begin, double end)
{
    if (r != NULL) {
        r->begin = begin;
        r->end = end;
    }
    return r;
}

struct remote *caller_begin(caller_log *log, void *environment, void *logger)
{
    struct remote *r = next;
    next = NULL;
    if (r != NULL) {
        r->log = log;
        r->environment = environment;
        r->logger = logger;
    }
    return r;
}
