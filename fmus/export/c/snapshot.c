/* Snapshots: the storage with mode and time, in one piece of memory. Until initialisation ends the
   storage holds the settings, so that `initialize` runs again on the restored settings; afterwards
   it is the live storage. Outputs and derivatives are computed again after a restore.

   The serialised form is the bytes of a snapshot and their checksum: a storage also holds indices
   that the kernels compute with, so damaged bytes must not become a state. */

#include "core.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct snapshot {
    char token[64];
    uint32_t interface, mode;
    double t, start_time, stop_time, step;
    double storage[];
};

#define BEFORE_RUNNING (INSTANTIATED | PREPARED | INITIALIZING)

static size_t snapshot_size(void) { return sizeof(struct snapshot) + model.n_slots * sizeof(double); }

size_t core_serialized_size(void) { return snapshot_size() + sizeof(uint64_t); }

/* FNV-1a: a change of any single byte changes the sum. */
static uint64_t checksum(const unsigned char *bytes, size_t size) {
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) sum = (sum ^ bytes[i]) * 0x100000001b3u;
    return sum;
}

static status check_snapshot(struct instance *c, const struct snapshot *s, const char *function) {
    unsigned alone = s->mode & (BEFORE_RUNNING | EVENT | CONTINUOUS_TIME | STEPPING | TERMINATED | BROKEN);
    unsigned other = s->interface == MODEL_EXCHANGE ? STEPPING : EVENT | CONTINUOUS_TIME;
    if (memcmp(s->token, model.token, strlen(model.token) + 1))
        return core_refuse(c, function, "the state does not belong to %s, or is damaged", model.identifier);
    if (s->interface != c->interface)
        return core_refuse(c, function, "the state belongs to the other interface (Model Exchange or Co-Simulation)");
    if (alone != s->mode || !alone || (alone & (alone - 1)) || (alone & other) || !isfinite(s->t) ||
        !isfinite(s->start_time) || isnan(s->stop_time) || !isfinite(s->step))
        return core_refuse(c, function, "the state is damaged");
    return OK;
}

status core_snapshot(struct instance *c, void **snapshot, const char *function) {
    if (core_need(c, snapshot, 1, "FMUState", function)) return FAILED;
    struct snapshot *s = *snapshot ? *snapshot : calloc(1, snapshot_size());
    if (!s) return core_refuse(c, function, "out of memory");
    strncpy(s->token, model.token, sizeof s->token - 1);
    s->interface = c->interface;
    s->mode = c->mode;
    s->t = c->t;
    s->start_time = c->start_time;
    s->stop_time = c->stop_time;
    s->step = c->step;
    memcpy(s->storage, c->mode & BEFORE_RUNNING ? c->settings : c->storage, model.n_slots * sizeof(double));
    *snapshot = s;
    return OK;
}

status core_restore(struct instance *c, const void *snapshot, const char *function) {
    if (core_need(c, snapshot, 1, "FMUState", function)) return FAILED;
    const struct snapshot *s = snapshot;
    if (check_snapshot(c, s, function)) return FAILED;
    c->mode = (enum mode)s->mode;
    c->t = s->t;
    c->start_time = s->start_time;
    c->stop_time = s->stop_time;
    c->step = s->step;
    c->stale = true;
    memcpy(c->mode & BEFORE_RUNNING ? c->settings : c->storage, s->storage, model.n_slots * sizeof(double));
    return OK;
}

void core_forget(void **snapshot) {
    free(*snapshot);
    *snapshot = NULL;
}

status core_serialize(struct instance *c, const void *snapshot, unsigned char *bytes, size_t size,
                      const char *function) {
    if (core_need(c, snapshot, 1, "FMUState", function)) return FAILED;
    if (core_need(c, bytes, 1, "serializedState", function)) return FAILED;
    if (size < core_serialized_size())
        return core_refuse(c, function, "%zu bytes for a state of %zu", size, core_serialized_size());
    memcpy(bytes, snapshot, snapshot_size());
    uint64_t sum = checksum(bytes, snapshot_size());
    memcpy(bytes + snapshot_size(), &sum, sizeof sum);
    return OK;
}

status core_deserialize(struct instance *c, const unsigned char *bytes, size_t size, void **snapshot,
                        const char *function) {
    if (core_need(c, bytes, 1, "serializedState", function)) return FAILED;
    if (core_need(c, snapshot, 1, "FMUState", function)) return FAILED;
    if (size != core_serialized_size())
        return core_refuse(c, function, "%zu bytes for a state of %zu", size, core_serialized_size());
    uint64_t sum;
    memcpy(&sum, bytes + snapshot_size(), sizeof sum);
    if (sum != checksum(bytes, snapshot_size())) return core_refuse(c, function, "the state is damaged");
    struct snapshot *s = malloc(snapshot_size());
    if (!s) return core_refuse(c, function, "out of memory");
    memcpy(s, bytes, snapshot_size()); /* bytes of the host need not be aligned */
    if (check_snapshot(c, s, function)) {
        free(s);
        return FAILED;
    }
    if (*snapshot) { /* as in core_snapshot: the host may hand in an old one */
        memcpy(*snapshot, s, snapshot_size());
        free(s);
    } else *snapshot = s;
    return OK;
}
