/* The functions of FMI as this process sees them: each packs its arguments for the host.

   A function of FMI may be there twice. What the loop of a run calls has `loop_` before its name
   and spares it waiting, as each answer of another process takes microseconds:

       loop_...Set...      is sent with the next call that has an answer, and its failure reported there
       loop_...DoStep      asks for the outputs at once that the loop got after the step before
       loop_...Get...      takes them from there

   So the FMU sees the same calls in the same order, and a step has one answer. */

#ifndef CALLER_H
#define CALLER_H

#include "channel.h"

/* An isolated instance: what the functions here take for the FMU's component. */
struct remote;

struct argument {
    enum kind kind;
    bool out;           /* the block is copied back */
    const void *values; /* of blocks, strings, binaries */
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
#define BLOBS(p, lengths, count) {.kind = POINTERS, .values = (p), .sizes = (lengths), .n = (count)}
#define OUT_TEXTS(p, count) {.kind = TEXTS_OUT, .out = true, .values = (p), .n = (count)}
#define OUT_BLOBS(p, count) {.kind = BLOBS_OUT, .out = true, .values = (p), .n = (count)}

typedef int caller_how(struct remote *r, enum function function, const struct argument *arguments, int n);

/* Make a call and wait for it, CALL(instance, function, arguments ...); or as the loop does. */
caller_how caller_call, caller_post, caller_step, caller_get;
#define VIA(how, instance, name, ...) \
    how(instance, F_##name, (struct argument[]){__VA_ARGS__}, \
        sizeof((struct argument[]){__VA_ARGS__}) / sizeof(struct argument))
#define CALL(...) VIA(caller_call, __VA_ARGS__)
#define POST(...) VIA(caller_post, __VA_ARGS__)
#define STEP(...) VIA(caller_step, __VA_ARGS__)
#define GET(...) VIA(caller_get, __VA_ARGS__)
#define CALL_PLAIN(instance, name) caller_call(instance, F_##name, NULL, 0)

/* Keep the time that the instance is told, of a step its begin and end, for the message if it crashes;
   return the instance. */
struct remote *caller_at(struct remote *r, double begin, double end);

/* Return the instance that is about to be made in this thread, and keep where its log goes. */
typedef void caller_log(struct remote *r, int status, const char *category, const char *text);
struct remote *caller_begin(caller_log *log, void *environment, void *function);
void *caller_environment(struct remote *r);
void *caller_log_function(struct remote *r);
void caller_say(struct remote *r, const char *text);

#endif
