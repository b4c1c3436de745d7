/* What an isolated FMU's two processes share: some calls at a time, and the lines of the FMU's log.

   The caller writes calls, then the number of the request; the host makes them, one after the
   other until one fails, and writes each status, then the number of the answer. Blocks of values
   lie in `data`, and the arguments say where: the memory is at another address in each process. */

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
    STATUS_WARNING = 1, /* of FMI 2.0 and 3.0, as the following */
    STATUS_ERROR = 3,
    STATUS_FATAL = 4,
};

enum kind {
    WORD,      /* a number by value, the bits of a double too */
    BLOCK,     /* where in data the values are; 0 is NULL */
    POINTERS,  /* where n such places are, of strings or binaries that go in */
    TEXTS_OUT, /* where n such places will be: strings that come out */
    BLOBS_OUT, /* and binaries; their sizes are the argument before */
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

/* What one side knows about how to wait for the other. */
struct waiting {
    _Atomic uint32_t sleeps;
    uint32_t until_long, interval; /* waits in haste until the next long one, and at the beginning */
    bool hasty;     /* watching long was in vain last time */
};

struct channel {
    _Alignas(64) _Atomic uint32_t request; /* number of the last one */
    int32_t n;                             /* calls in it */
    uint64_t used;                         /* bytes of data */
    struct call calls[MAX_CALLS];
    _Alignas(64) _Atomic uint32_t answer;
    _Atomic int32_t done; /* calls that were made, the failed one and the one that is being made included */
    _Alignas(64) struct waiting caller, host;
    _Alignas(64) _Atomic uint32_t logged, read; /* lines written and read, so many in all */
    struct log_line lines[LOG_LINES];
    _Alignas(64) unsigned char data[];
};

static inline size_t aligned(size_t n) { return (n + 15) & ~(size_t)15; }

/* Write the number of a request or answer, and wake the other side if it sleeps. */
void channel_post(_Atomic uint32_t *word, uint32_t number, struct waiting *other);

/* Wake who sleeps although nothing came. */
void channel_wake(_Atomic uint32_t *word);

/* Wait until the word is `number`, or a twentieth of a second; tell whether it is. */
bool channel_wait(_Atomic uint32_t *word, uint32_t number, struct waiting *self);

#endif
