/* The reference of test_million_steps.py: the same loop by hand, for this one system.

   Plant as an FMU (Co-Simulation), sliding surface, sensor dynamics 1/(mu s + 1)^2, Algorithm I,
   first-order low-pass filter; x, u, M recorded and their statistics kept at every step.

   usage: reference_loop library guid n  ->  prints seconds, x and u at the end */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

static void quiet(fmi2ComponentEnvironment e, fmi2String i, fmi2Status s, fmi2String c, fmi2String m, ...) {
    (void)e, (void)i, (void)s, (void)c, (void)m;
}

static double sign(double x) { return (x > 0) - (x < 0); }

typedef struct {
    double low, high, sum, squares;
} Statistics;

static void watch(Statistics *s, double x) {
    s->low = x < s->low ? x : s->low;
    s->high = x > s->high ? x : s->high;
    s->sum += x;
    s->squares += x * x;
}

int main(int argc, char **argv) {
    if (argc != 4) return 1;
    void *library = dlopen(argv[1], RTLD_NOW);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 1;
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)dlsym(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)dlsym(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)dlsym(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave =
        (fmi2ExitInitializationModeTYPE *)dlsym(library, "fmi2ExitInitializationMode");
    fmi2GetRealTYPE *get = (fmi2GetRealTYPE *)dlsym(library, "fmi2GetReal");
    fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)dlsym(library, "fmi2SetReal");
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)dlsym(library, "fmi2DoStep");
    fmi2CallbackFunctions callbacks = {quiet, calloc, free, NULL, NULL};
    fmi2Component c = instantiate("plant", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
    if (!c || setup(c, fmi2False, 0, 0, fmi2False, 0) || enter(c) || leave(c)) return 1;

    const long n = atol(argv[3]);
    const double h = 0.01, mu = 0.008, tau = 0.02, r = h / mu, decay = exp(-r), approach = -expm1(-h / tau);
    /* value references are slots: u, d, a, x, v */
    const fmi2ValueReference outputs[] = {3, 4}, inputs[] = {0, 1};
    double xv[2], in[2] = {0, 0}, y = 0, z = 0, M = 100, last = 0, filtered = 0, u = 0, s = 0;
    double *record = malloc((size_t)(n + 1) * 3 * sizeof(double));
    Statistics kept[3];
    for (int i = 0; i < 3; i++) kept[i] = (Statistics){INFINITY, -INFINITY, 0, 0};
    struct timespec a, b;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (long k = 0; k <= n; k++) {
        if (get(c, outputs, 2, xv) > fmi2Warning || !isfinite(xv[0]) || !isfinite(xv[1])) return 1;
        s = xv[1] + 1.0 * xv[0];
        double g = sign(y);
        if (g * last < 0) M = fmax(M / 1.1, 1.0);
        if (g != 0) last = g;
        u = -M * g;
        double *row = record + 3 * k;
        row[0] = xv[0], row[1] = u, row[2] = M;
        for (int i = 0; i < 3; i++) watch(&kept[i], row[i]);
        if (k == n) break;
        in[0] = filtered;
        if (set(c, inputs, 2, in) > fmi2Warning) return 1;
        if (step(c, (double)k * h, h, fmi2True) > fmi2Warning) return 1;
        double e = y - s, z0 = z;
        y = s + decay * ((1 + r) * e + h * z0);
        z = decay * ((1 - r) * z0 - r * e / mu);
        filtered += approach * (u - filtered);
        if (!isfinite(y) || !isfinite(filtered)) return 1;
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    printf("%.9f %.17g %.17g\n", (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec),
           xv[0], M);
    return 0;
}
