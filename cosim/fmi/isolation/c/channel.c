/* Waiting for the other process: spin on the word, because the answer usually comes at once, then sleep.

   Where all cores are busy, sleeping lets the other process run and spinning keeps it from running.
   Where a core is free, waking up costs more than everything else. So a long spin that timed
   out shortens the next ones, until a short one sees the answer: then the other process has a core of
   its own. Long spins are repeated, because a core may have become free: soon at first, and less and
   less often while they time out. Linux wakes the sleeper through a futex. Other systems have no such
   call between processes; there the sleeper looks again after growing pauses. */

#if defined __linux__
#define _GNU_SOURCE /* syscall */
#endif

#include "channel.h"

#include <time.h>

#if defined __linux__
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

enum {
    LONG_SPIN = 50000, /* ns */
    SHORT_SPIN = 300,
    TRY_SOON = 16, /* short spins until the next long one */
    TRY_SELDOM = 1024,
    LONGEST_SLEEP = 50000000,
};

static inline void pause_a_moment(void)
{
#if defined __x86_64__
    __builtin_ia32_pause();
#elif defined __aarch64__
    __asm__ volatile("yield");
#endif
}

static int64_t now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1000000000 * (int64_t)t.tv_sec + t.tv_nsec;
}

void channel_wake(_Atomic uint32_t *word)
{
#if defined __linux__
    syscall(SYS_futex, word, FUTEX_WAKE, 1, NULL, NULL, 0);
#else
    (void)word;
#endif
}

void channel_post(_Atomic uint32_t *word, uint32_t number, struct waiting *other)
{
    atomic_store(word, number); /* sequentially consistent with `sleeps`: one of the two sees the other */
    if (atomic_load(&other->sleeps))
        channel_wake(word);
}

static bool spin(_Atomic uint32_t *word, uint32_t number, int64_t ns)
{
    const int64_t end = now() + ns;
    do {
        for (int i = 0; i < 8; i++) {
            if (atomic_load_explicit(word, memory_order_acquire) == number)
                return true;
            pause_a_moment();
        }
    } while (now() < end);
    return false;
}

static void sleep_until(_Atomic uint32_t *word, uint32_t number, struct waiting *self)
{
#if defined __linux__
    atomic_store(&self->sleeps, 1);
    const uint32_t seen = atomic_load(word);
    if (seen != number)
        syscall(SYS_futex, word, FUTEX_WAIT, seen, &(struct timespec){0, LONGEST_SLEEP}, NULL, 0);
    atomic_store(&self->sleeps, 0);
#else
    (void)self;
    for (long ns = 1000, all = 0; all < LONGEST_SLEEP && atomic_load(word) != number; all += ns, ns += ns / 8)
        nanosleep(&(struct timespec){0, ns}, NULL);
#endif
}

bool channel_wait(_Atomic uint32_t *word, uint32_t number, struct waiting *self)
{
    const bool is_long = !self->hasty || self->until_long == 0;
    const bool came = spin(word, number, is_long ? LONG_SPIN : SHORT_SPIN);
    if (came) {
        self->hasty = false;
        self->interval = TRY_SOON;
    } else if (is_long) {
        self->interval = self->hasty && self->interval < TRY_SELDOM ? 2 * self->interval : self->interval;
        self->until_long = self->interval;
        self->hasty = true;
    } else {
        self->until_long--;
    }
    if (!came)
        sleep_until(word, number, self);
    return atomic_load(word) == number;
}
