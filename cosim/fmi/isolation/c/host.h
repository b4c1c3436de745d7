/* Reading the words of a call in the host; functions.c is generated from them (functions.py). */

#ifndef HOST_H
#define HOST_H

#include "channel.h"

static inline double real(uint64_t word) { return (union { uint64_t w; double d; }){word}.d; }
static inline void *pointer(uint64_t word) { return (void *)(uintptr_t)word; }

/* Call a function of the FMU, which is not one that makes or frees an instance; return its status. */
int perform(enum function function, void *f, void *instance, const uint64_t a[]);

#endif
