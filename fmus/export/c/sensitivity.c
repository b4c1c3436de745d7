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

static status check_direction(struct instance *c, struct direction d, bool whole, bool unknowns, const char *function) {
    size_t total = 0;
    for (size_t i = 0; i < d.n; i++) {
        const struct variable *v;
        uint32_t size = core_extent(d.references[i], whole, &v);
        if (!size) return core_refuse(c, function, "unknown value reference %u", (unsigned)d.references[i]);
        if (unknowns ? !is_unknown(v->zone) : !is_known(v->zone, c->mode))
            return core_refuse(c, function, "%s is not %s", v->name,
                               unknowns ? "an output, state or derivative" : "an input or state, or a parameter "
                               "in initialization mode");
        total += size;
    }
    if (total == d.n_values) return OK;
    return core_refuse(c, function, "%zu values for %s of %zu elements", d.n_values,
                       unknowns ? "unknowns" : "knowns", total);
}

/* Add e v to the knowns in `storage`. */
static void move(double *storage, struct direction known, bool whole, const double *seed, double e) {
    const struct variable *v;
    for (size_t i = 0; i < known.n; i++)
        for (uint32_t k = 0, size = core_extent(known.references[i], whole, &v); k < size; k++)
            storage[known.references[i] + k] += e * *seed++;
}

/* Add w times the unknowns in `storage` to `result`. */
static void collect(const double *storage, struct direction unknown, bool whole, double w, double *result) {
    const struct variable *v;
    for (size_t i = 0; i < unknown.n; i++)
        for (uint32_t k = 0, size = core_extent(unknown.references[i], whole, &v); k < size; k++)
            *result++ += w * storage[unknown.references[i] + k];
}

/* Return the width that moves no known by more than a thousandth of its size; +inf for a zero seed. */
static double width_of(const double *point, struct direction known, bool whole, const double *seed) {
    const struct variable *v;
    double width = INFINITY;
    for (size_t i = 0; i < known.n; i++)
        for (uint32_t k = 0, size = core_extent(known.references[i], whole, &v); k < size; k++, seed++) {
            double room = RELATIVE_WIDTH * fmax(fabs(point[known.references[i] + k]), SMALLEST_SIZE);
            if (*seed != 0.0) width = fmin(width, room / fabs(*seed));
        }
    return width;
}

status core_differentiate(struct instance *c, struct direction unknown, struct direction known, bool whole,
                          const double *seed, double *result, const char *function) {
    if (core_need(c, unknown.references, unknown.n, "unknowns", function) ||
        core_need(c, known.references, known.n, "knowns", function) ||
        core_need(c, seed, known.n_values, "seed", function) ||
        core_need(c, result, unknown.n_values, "sensitivity", function))
        return FAILED;
    if (model.step) return core_refuse(c, function, "%s is a sampled block, without derivatives", model.identifier);
    if (check_direction(c, unknown, whole, true, function) || check_direction(c, known, whole, false, function)) return FAILED;
    for (size_t i = 0; i < known.n_values; i++)
        if (!isfinite(seed[i])) return core_refuse(c, function, "seed %g is not finite", seed[i]);
    bool early = c->mode == INITIALIZING;
    const double *point = early ? c->settings : c->storage;
    double width = width_of(point, known, whole, seed);
    for (size_t i = 0; i < unknown.n_values; i++) result[i] = 0.0;
    if (!isfinite(width)) return OK;
    static const double node[] = {1.0, -1.0, 2.0, -2.0}, weight[] = {4.0 / 6.0, -4.0 / 6.0, -1.0 / 12.0, 1.0 / 12.0};
    for (int k = 0; k < 4; k++) {
        memcpy(c->trial, point, model.n_slots * sizeof(double));
        move(c->trial, known, whole, seed, node[k] * width);
        int32_t code = early && model.initialize ? model.initialize(c->trial, c->t, 0.0) : 0;
        if (!code) code = core_run(c->trial, c->t);
        if (code)
            return core_refuse(c, function, "the equations failed near t = %.9g (code %d)", c->t, (int)code);
        collect(c->trial, unknown, whole, weight[k] / width, result);
    }
    uint32_t bad = core_first_not_finite(result, 0, (uint32_t)unknown.n_values);
    return bad < unknown.n_values ? core_refuse(c, function, "derivative %u is not finite", (unsigned)bad) : OK;
}
