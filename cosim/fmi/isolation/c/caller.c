#include "caller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_FOLLOWING = 8, MAX_GET_ARGUMENTS = 4 };

/* A get that follows every step in the loop; `index` is its call in the last request, or -1. */
struct following {
    enum function function;
    struct argument arguments[MAX_GET_ARGUMENTS];
    int n, index;
};

struct remote {
    struct channel *channel;
    size_t capacity;                           /* bytes of channel->data */
    int32_t (*check)(int64_t, double, double); /* not 0 when waiting is over: it died, or Ctrl-C */
    bool ended;
    uint32_t number; /* of the last request */
    int waiting;     /* calls that are not sent yet */
    double begin, end; /* of the last step, or the time that was set */
    struct following following[MAX_FOLLOWING];
    int n_following;
    caller_log *log;
    void *environment, *log_function;
};

static _Thread_local struct remote *next;

/* ------------------------------------------------------------------ from Python */

EXPORT const char *function_name(int function)
{
    static const char *const names[] = {
#define X(name) #name,
        FUNCTIONS
#undef X
    };
    return function >= 0 && function < N_FUNCTIONS ? names[function] : NULL;
}

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

/* Return the function that the host calls, or called last; -1 before it called any. */
EXPORT int caller_function(struct remote *r)
{
    const int done = atomic_load(&r->channel->done);
    return done > 0 ? r->channel->calls[done - 1].function : -1;
}

/* Return the time at which it does: before the end of a step that is still to be made, or in it, its begin. */
EXPORT double caller_time(struct remote *r)
{
    const struct channel *c = r->channel;
    for (int i = atomic_load(&c->done) - 1; i >= 0 && i < c->n; i++)
        if (c->calls[i].function == F_fmi2DoStep || c->calls[i].function == F_fmi3DoStep)
            return r->begin;
    return r->end;
}

/* ------------------------------------------------------------------------- log */

void caller_say(struct remote *r, const char *text)
{
    if (r != NULL && r->log != NULL)
        r->log(r, STATUS_ERROR, "isolated", text);
}

static void pass_on_log(struct remote *r)
{
    struct channel *c = r->channel;
    while (atomic_load(&c->read) != atomic_load(&c->logged)) {
        const struct log_line *line = &c->lines[atomic_load(&c->read) % LOG_LINES];
        if (r->log != NULL)
            r->log(r, line->status, line->category, line->text);
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
            pass_on_log(r); /* what it said last */
            r->ended = true;
            return false;
        }
    }
    pass_on_log(r);
    return true;
}

static bool send(struct remote *r)
{
    struct channel *c = r->channel;
    for (int i = 0; i < r->n_following; i++)
        r->following[i].index = -1;
    c->n = r->waiting;
    r->waiting = 0;
    channel_post(&c->request, ++r->number, &c->host);
    return answered(r);
}

/* Wait until the host has loaded the FMU; return 0, or not 0 where it could not, and the reason. */
EXPORT int caller_await(struct remote *r)
{
    r->number = 1;
    return answered(r) ? r->channel->calls[0].status : STATUS_FATAL;
}

EXPORT const char *caller_reason(struct remote *r) { return (const char *)r->channel->data; }

/* Ask the host to end, without waiting for it; tell whether it listens. */
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
    return a->sizes != NULL ? a->sizes[i] : texts[i] != NULL ? strlen(texts[i]) + 1 : 0;
}

static size_t room(const struct argument *a)
{
    if (a->kind == BLOCK)
        return aligned(a->n * a->size);
    size_t bytes = a->kind == WORD ? 0 : aligned(8 * a->n);
    for (size_t i = 0; a->kind == POINTERS && i < a->n; i++)
        bytes += aligned(size_of(a, i));
    return bytes;
}

/* Write an argument to data from `used` on. What comes out goes in as well: a function that fails may
   leave it as it was. */
static void pack(unsigned char *data, size_t used, const struct argument *a, struct slot *s)
{
    *s = (struct slot){a->kind, (uint32_t)a->n, a->kind == WORD ? a->word : a->values != NULL ? used : 0};
    if (a->kind == BLOCK && a->values != NULL)
        memcpy(data + used, a->values, a->n * a->size);
    if (a->kind == TEXTS_OUT || a->kind == BLOBS_OUT)
        memset(data + used, 0, 8 * a->n);
    if (a->kind != POINTERS)
        return;
    uint64_t *places = (uint64_t *)(data + used);
    const void *const *values = a->values;
    used += aligned(8 * a->n);
    for (size_t i = 0; i < a->n; i++) {
        const size_t size = size_of(a, i);
        places[i] = values[i] != NULL ? used : 0;
        if (values[i] != NULL)
            memcpy(data + used, values[i], size);
        used += aligned(size);
    }
}

/* Copy back what came out; strings and binaries stay in data until the next call, as FMI lets them. */
static void unpack(unsigned char *data, const struct argument *a, const struct slot *s, int status)
{
    if (!a->out || a->values == NULL)
        return;
    if (a->kind == BLOCK) {
        memcpy((void *)a->values, data + s->word, a->n * a->size);
        return;
    }
    const uint64_t *places = (const uint64_t *)(data + s->word);
    for (size_t i = 0; status <= STATUS_WARNING && i < a->n; i++)
        ((const void **)a->values)[i] = places[i] != 0 ? data + places[i] : NULL;
}

/* ------------------------------------------------------------------------ calls */

/* Add a call to the next request; return its index, or -1 where it does not fit. */
static int add(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    struct channel *c = r->channel;
    size_t used = r->waiting == 0 ? 16 : c->used; /* 0 is NULL */
    size_t bytes = 0;
    for (int i = 0; i < n; i++)
        bytes += room(&arguments[i]);
    if (r->waiting == MAX_CALLS || bytes > r->capacity - used) {
        if (r->waiting != 0)
            return send(r) && c->calls[c->n - 1].status <= STATUS_WARNING ? add(r, function, arguments, n) : -1;
        char text[120];
        snprintf(text, sizeof text, "%s passes more than the %zu MB that an isolated FMU has room for",
                 function_name(function), r->capacity >> 20);
        caller_say(r, text);
        return -1;
    }
    struct call *call = &c->calls[r->waiting];
    call->function = function;
    call->n = n;
    for (int i = 0; i < n; i++) {
        pack(c->data, used, &arguments[i], &call->arguments[i]);
        used += room(&arguments[i]);
    }
    c->used = used;
    return r->waiting++;
}

/* Take over what a call of the last request brought; return its status, or that of a call before which failed. */
static int take(struct remote *r, int index, const struct argument *arguments)
{
    struct channel *c = r->channel;
    const int done = atomic_load(&c->done);
    if (index >= done)
        return c->calls[done - 1].status;
    const struct call *call = &c->calls[index];
    for (int i = 0; i < call->n; i++)
        unpack(c->data, &arguments[i], &call->arguments[i], call->status);
    return call->status;
}

int caller_call(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (r->ended)
        return STATUS_FATAL;
    const int index = add(r, function, arguments, n);
    if (index < 0 || !send(r))
        return r->ended ? STATUS_FATAL : STATUS_ERROR;
    return take(r, index, arguments);
}

int caller_post(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    if (r->ended)
        return STATUS_FATAL;
    return add(r, function, arguments, n) < 0 ? r->ended ? STATUS_FATAL : STATUS_ERROR : 0;
}

int caller_step(struct remote *r, enum function function, const struct argument *arguments, int n)
{
    int indices[MAX_FOLLOWING];
    if (r->ended)
        return STATUS_FATAL;
    if (r->waiting + 1 + r->n_following > MAX_CALLS)
        r->n_following = 0;
    const int index = add(r, function, arguments, n);
    if (index < 0)
        return r->ended ? STATUS_FATAL : STATUS_ERROR;
    for (int i = 0; i < r->n_following; i++)
        indices[i] = add(r, r->following[i].function, r->following[i].arguments, r->following[i].n);
    if (!send(r))
        return STATUS_FATAL;
    for (int i = 0; i < r->n_following; i++)
        r->following[i].index = indices[i] < atomic_load(&r->channel->done) ? indices[i] : -1;
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
    struct following *f = r->following, *const end = f + r->n_following;
    while (f < end && (f->function != function || !is_same(f->arguments, arguments, n)))
        f++;
    if (f < end && f->index >= 0 && r->waiting == 0 && !r->ended)
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
    r->begin = begin;
    r->end = end;
    return r;
}

struct remote *caller_begin(caller_log *log, void *environment, void *function)
{
    struct remote *r = next;
    next = NULL;
    if (r != NULL) {
        r->log = log;
        r->environment = environment;
        r->log_function = function;
    }
    return r;
}

void *caller_environment(struct remote *r) { return r->environment; }
void *caller_log_function(struct remote *r) { return r->log_function; }
