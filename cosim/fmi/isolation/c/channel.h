/* The memory that the two processes of an isolated FMU share: calls, and lines of the FMU's log.

   The caller writes calls, then the number of the request. The host makes the calls one after the
   other until one fails, writes the status of each, then the number of the answer. Blocks of values
   lie in `data`; arguments hold their places in it, because each process has the memory at another
   address. */

#ifndef CHANNEL_H
#define CHANNEL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "functions.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum {
    MAX_ARGUMENTS = 12, /* fmi3InstantiateCoSimulation has the most */
    MAX_CALLS = 16,
    LOG_LINES = 64,
    LOG_TEXT = 2048,
    STATUS_WARNING = 1, /* this and the next two are the same in FMI 2.0 and 3.0 */
    STATUS_ERROR = 3,
    STATUS_FATAL = 4,
    STATUS_PENDING = 5, /* FMI 2.0 only */
};

enum kind {
    WORD,      /* a number by value, or the bits of a double */
    BLOCK,     /* the place of values in data; 0 is NULL */
    POINTERS,  /* the place of n places: strings or binary data as inputs */
    TEXTS_OUT, /* the place of n places that the host writes: strings as outputs */
    BLOBS_OUT, /* the same for binary data; the argument before has their sizes */
};

struct slot {
    uint32_t kind, n;
    uint64_t word;
};

struct call {
    int32_t function, n, status; /* n arguments */
    struct slot arguments[MAX_ARGUMENTS];
};

struct log_line {
    int32_t status;
    char category[60], text[LOG_TEXT];
};

/* The state of one side's waiting for the other. */
struct waiting {
    _Atomic uint32_t sleeps;
    uint32_t until_long, interval; /* short spins until the next long one, and their number at first */
    bool hasty;                    /* the last long spin timed out */
};

struct channel {
    _Alignas(64) _Atomic uint32_t request; /* number of the last request */
    int32_t n;                             /* calls in it */
    uint64_t used;                         /* bytes of data */
    struct call calls[MAX_CALLS];
    _Alignas(64) _Atomic uint32_t answer;
    _Atomic int32_t done; /* number of calls made, a failed and the present one included */
    _Alignas(64) struct waiting caller, host;
    _Alignas(64) _Atomic uint32_t logged, read; /* number of lines written, and of lines read */
    struct log_line lines[LOG_LINES];
    _Alignas(64) unsigned char data[];
};

static inline bool succeeded(int status) { return status == 0 || status == STATUS_WARNING; }
static inline size_t aligned(size_t n) { return (n + 15) & ~(size_t)15; }

/* Return the name of a function of FMI by its number in functions.h, or NULL. */
const char *function_name(int function);

/* Write the number of a request or answer, and wake the other side if it sleeps. */
void channel_post(_Atomic uint32_t *word, uint32_t number, struct waiting *other);

/* Wake the side that sleeps at the word before its number has come. */
void channel_wake(_Atomic uint32_t *word);

/* Wait until the word is `number`, for a twentieth of a second at most; return whether it is. */
bool channel_wait(_Atomic uint32_t *word, uint32_t number, struct waiting *self);

#endif
