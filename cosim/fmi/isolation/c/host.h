/* The words of a call, as the host reads them in the generated functions.c (functions.py). */

#ifndef HOST_H
#define HOST_H

#include "channel.h"

static inline double real(uint64_t word) { return (union { uint64_t w; double d; }){word}.d; }
static inline void *pointer(uint64_t word) { return (void *)(uintptr_t)word; }

/* Call a function of the FMU, other than those that make or free an instance; return its status. */
int perform(enum function function, void *f, void *instance, const uint64_t a[]);

#endif
