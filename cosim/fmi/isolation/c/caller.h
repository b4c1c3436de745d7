/* The caller's side of an isolated FMU: each function of FMI packs its arguments for the host.

   A function of FMI may exist twice. The loop of a run calls the one with `loop_` before its name,
   which saves a wait, because every answer of another process takes microseconds:

       loop_...Set...      is sent with the next call that has an answer, which reports its failure
       loop_...DoStep      also asks for the outputs that the loop got after the step before
       loop_...Get...      takes its values from that answer

   The FMU sees the same calls in the same order, and a step has one answer.

   Contract of the arrays. A call reads and writes the caller's arrays before it returns, and keeps
   none of them. There is one exception: loop_...Get... remembers the addresses of its arrays, and
   every later loop_...DoStep reads the value references and the former values again. An importer that
   calls loop_...Get... keeps these arrays in place, with the same length, until it frees the instance.
   Strings and binary data that come out stay valid until the next call, as FMI says.

   A call with a NULL instance returns an error status, or does nothing where it frees the instance; a
   NULL array reaches the FMU as NULL. The FMU may damage the host's process, so its answers are checked
   before they are used: only statuses, lines of the log and the contents of blocks are taken from
   shared memory, never the place or length of a block. */

#ifndef CALLER_H
#define CALLER_H

#include "channel.h"

/* An isolated instance, which the importer uses as the FMU's component. */
struct remote;

struct argument {
    enum kind kind;
    bool out;           /* whether the block is copied back */
    const void *values; /* of blocks, strings, binary data; may be NULL */
    const size_t *sizes;
    size_t n, size;
    uint64_t word;
};

#define NUMBER(x) {.kind = WORD, .word = (uint64_t)(x)}
#define HANDLE(p) {.kind = WORD, .word = (uintptr_t)(p)}
#define REAL(x) {.kind = WORD, .word = ((union { double d; uint64_t w; }){x}).w}
#define IN(p, count) {.kind = BLOCK, .values = (p), .n = (count), .size = sizeof *(p)}
#define OUT(p, count) {.kind = BLOCK, .out = true, .values = (p), .n = (count), .size = sizeof *(p)}
#define TEXT(p) {.kind = BLOCK, .values = (p), .n = (p) != NULL ? strlen(p) + 1 : 0, .size = 1}
#define TEXTS(p, count) {.kind = POINTERS, .values = (p), .n = (count)}
#define BLOBS(p, lengths, count) \
    {.kind = POINTERS, .values = (lengths) != NULL ? (p) : NULL, .sizes = (lengths), .n = (count)}
#define OUT_TEXTS(p, count) {.kind = TEXTS_OUT, .out = true, .values = (p), .n = (count)}
#define OUT_BLOBS(p, count) {.kind = BLOBS_OUT, .out = true, .values = (p), .n = (count)}

typedef int caller_how(struct remote *r, enum function function, const struct argument *arguments, int n);

/* Make a call and wait for its answer; or post, step or get as described above. */
caller_how caller_call, caller_post, caller_step, caller_get;
#define CALL(r, name, ...) \
    caller_call(r, F_##name, (struct argument[]){__VA_ARGS__}, \
                sizeof((struct argument[]){__VA_ARGS__}) / sizeof(struct argument))

/* Keep the time of the call, or the beginning and end of a step, for the message of a crash; return
   the instance. */
struct remote *caller_at(struct remote *r, double begin, double end);

/* Return the instance that this thread is about to make, or NULL, and keep the importer's logger. */
typedef void caller_log(void *logger, void *environment, int status, const char *category, const char *text);
struct remote *caller_begin(caller_log *log, void *environment, void *logger);

/* Pass a line of this side to the importer's logger. */
void caller_say(struct remote *r, const char *text);

#endif
