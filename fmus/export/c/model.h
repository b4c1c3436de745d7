/* The contract between an exported model and the FMI front end.

   A model is a storage of `n_slots` doubles in contiguous memory and up to five
   kernels that read and write it (only kernels use the slots after the last zone).
   `fmus/export/link.py` writes one C file for each model, which defines `model`; no other part
   of the front end knows which model it serves.

   The storage is a sequence of zones, in this order:
       inputs | outputs | states | derivatives | locals | parameters
   `derivatives` has the order and the size of `states` (Continuous) or is empty
   (Block). A variable is a scalar or a row-major array at consecutive slots. */

#ifndef STRUCTCOSIM_MODEL_H
#define STRUCTCOSIM_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Return 0, or another value if the kernel failed and the storage is not valid. */
typedef int32_t model_kernel(double *storage, double t, double h);

enum zone { INPUT, OUTPUT, STATE, DERIVATIVE, LOCAL, PARAMETER, ZONES };

struct variable {
    const char *name;
    const uint32_t *shape; /* `rank` extents; NULL for a scalar */
    uint32_t rank;
    uint32_t first; /* first slot */
    uint32_t size;  /* number of slots, at least 1 */
    uint8_t zone;   /* enum zone */
    bool listed;    /* in the modelDescription; others have no value reference */
    double min, max;
};

struct model {
    const char *identifier;           /* C name of the model */
    const char *token;                /* GUID (FMI 2), instantiation token (FMI 3) */
    uint32_t n_slots;                 /* also the value reference of time in FMI 3 */
    uint32_t zone[ZONES + 1];         /* first slot of every zone; zone[ZONES] ends the last */
    const struct variable *variables; /* by ascending `first` */
    uint32_t n_variables;
    const void *start;                /* n_slots doubles, any alignment */
    model_kernel *initialize, *derivatives, *outputs, *advance, *step; /* NULL: none */
};

extern const struct model model;

#endif
