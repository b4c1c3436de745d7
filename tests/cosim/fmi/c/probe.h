/* A model that exercises an importer, shared by the FMUs probe2.c (FMI 2.0) and probe3.c (FMI 3.0).

     r_out = 2 r_in; every other NAME_out = NAME_in + 1, b_out = not b_in, e_out = e_in
     v_out[i] = 2 v_in[n + 1 - i]
     text_out = text_in
     label_length, blob_sum: the length of the string parameter, the sum of the bytes of the binary one
     x' = 1; a state event takes 1 from x when 1 - x <= 0:           x(t) = t mod 1
     stair counts time events at 0.75, 1.5, ...                       floor(t / 0.75)
     quarters counts step events, one at every fourth completed step

   The simulation is asked to end at end_at; a step over early_at stops there. In Model Exchange
   inputs that are not continuous can be set at events only. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { X = 11, DER_X, STAIR, QUARTERS, END_AT, EARLY_AT, LABEL = 9, LABEL_LENGTH = 10, TEXT_IN = 17, TEXT_OUT };
enum { R_IN = 1, R_OUT, I_IN, I_OUT, B_IN, B_OUT, E_IN, E_OUT, F32_IN = 36, N = 40, V_IN, V_OUT, BLOB, BLOB_SUM, Z };

struct probe {
    long double in[64]; /* inputs and parameters by value reference; long double holds a 64-bit integer */
    double v[8], time, x, next;
    char text[64];
    int n, stair, quarters, steps, label_length, blob_sum;
    bool step_event, terminated, continuous_time;
};

static struct probe *probe_new(void) {
    struct probe *p = calloc(1, sizeof *p);
    p->n = 2;
    p->next = 0.75;
    p->in[END_AT] = p->in[EARLY_AT] = 1e9;
    p->in[R_IN] = 0.5; /* as in modelDescription.xml */
    p->in[I_IN] = 7;
    p->in[B_IN] = p->in[E_IN] = 1;
    for (int vr = 20; vr < 36; vr += 2) p->in[vr] = 1;
    p->in[F32_IN] = 0.5;
    p->v[0] = 1.5;
    p->v[1] = 2.5;
    return p;
}

static long double probe_get(const struct probe *p, unsigned vr) {
    switch (vr) {
    case R_OUT: return 2 * p->in[R_IN];
    case B_OUT: return !p->in[B_IN];
    case E_OUT: return p->in[E_IN];
    case LABEL_LENGTH: return p->label_length;
    case BLOB_SUM: return p->blob_sum;
    case X: return p->x;
    case DER_X: return 1;
    case STAIR: return p->stair;
    case QUARTERS: return p->quarters;
    case N: return p->n;
    case Z: return 1.0 - p->x;
    default: return (vr == I_OUT || (vr >= 21 && vr < N && vr % 2)) ? p->in[vr - 1] + 1 : p->in[vr];
    }
}

static void probe_event(struct probe *p) {
    while (p->x >= 1.0) p->x -= 1.0;
    for (; p->time >= p->next; p->next += 0.75) p->stair++;
    p->quarters += p->step_event;
    p->step_event = false;
}

static void probe_completed(struct probe *p) { p->step_event = ++p->steps % 4 == 0; }
