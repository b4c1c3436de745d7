/* Directional derivatives of outputs and derivatives by central differences along the direction,
   at two step widths, extrapolated (Richardson):

       D(e) = (f(z + e v) - f(z - e v)) / (2 e),    f'v = (4 D(e) - D(2 e)) / 3 + O(e^4)

   The width moves every known by at most a thousandth of its size (of 1e-3 near zero): exact to
   rounding where the equations are linear, about 1e-11 relative where they are smooth. Four
   evaluations whatever the number of knowns. */

#include "core.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RELATIVE_WIDTH 1e-3
#define SMALLEST_SIZE 1e-3

static bool is_unknown(enum zone zone) { return zone == OUTPUT || zone == STATE || zone == DERIVATIVE; }

static bool is_known(enum zone zone, enum mode mode) {
    return zone == INPUT || zone == STATE || (zone == PARAMETER && mode == INITIALIZING);
}

static status check(struct instance *c, const uint32_t *slots, size_t n, bool unknowns, const char *function) {
    for (size_t i = 0; i < n; i++) {
        const struct variable *v = core_locate(slots[i]);
        if (!v || !v->listed)
            return core_refuse(c, function, "unknown value reference %u", (unsigned)slots[i]);
        if (unknowns ? !is_unknown(v->zone) : !is_known(v->zone, c->mode))
            return core_refuse(c, function, "%s is not %s", v->name,
                               unknowns ? "an output, state or derivative" : "an input or state, or a parameter "
                               "in initialization mode");
    }
    return OK;
}

/* f(z + e v), left in c->trial. */
static status evaluate_at(struct instance *c, const uint32_t *known, size_t n, const double *seed, double e,
                          const char *function) {
    bool early = c->mode == INITIALIZING;
    memcpy(c->trial, early ? c->settings : c->record, model.n_slots * sizeof(double));
    for (size_t i = 0; i < n; i++) c->trial[known[i]] += e * seed[i];
    int32_t code = early && model.initialize ? model.initialize(c->trial, c->t, 0.0) : 0;
    if (!code) code = core_run(c->trial, c->t);
    if (code) return core_refuse(c, function, "the equations gave up beside t = %.9g (code %d)", c->t, (int)code);
    return OK;
}

status core_differentiate(struct instance *c, const uint32_t *unknown, size_t n_unknown, const uint32_t *known,
                          size_t n_known, const double *seed, double *result, const char *function) {
    if (core_need(c, unknown, n_unknown, "unknowns", function) || core_need(c, known, n_known, "knowns", function) ||
        core_need(c, seed, n_known, "seed", function) || core_need(c, result, n_unknown, "sensitivity", function))
        return FAILED;
    if (model.step) return core_refuse(c, function, "%s is a sampled block, without derivatives", model.identifier);
    if (check(c, unknown, n_unknown, true, function) || check(c, known, n_known, false, function)) return FAILED;
    const double *point = c->mode == INITIALIZING ? c->settings : c->record;
    double width = INFINITY;
    for (size_t i = 0; i < n_known; i++) {
        if (!isfinite(seed[i])) return core_refuse(c, function, "seed %g is not finite", seed[i]);
        if (seed[i] != 0.0)
            width = fmin(width, RELATIVE_WIDTH * fmax(fabs(point[known[i]]), SMALLEST_SIZE) / fabs(seed[i]));
    }
    for (size_t i = 0; i < n_unknown; i++) result[i] = 0.0;
    if (!isfinite(width)) return OK; /* no direction */
    static const double node[] = {1.0, -1.0, 2.0, -2.0}, weight[] = {4.0 / 6.0, -4.0 / 6.0, -1.0 / 12.0, 1.0 / 12.0};
    for (int k = 0; k < 4; k++) {
        if (evaluate_at(c, known, n_known, seed, node[k] * width, function)) return FAILED;
        for (size_t i = 0; i < n_unknown; i++) result[i] += weight[k] / width * c->trial[unknown[i]];
    }
    for (size_t i = 0; i < n_unknown; i++)
        if (!isfinite(result[i])) return core_refuse(c, function, "the derivative is not finite");
    return OK;
}
