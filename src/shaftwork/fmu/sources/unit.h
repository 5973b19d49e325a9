/* One instance of a model as FMI wants it, the same for all versions: fmi2.c and fmi3.c give it their names. */

#ifndef UNIT_H
#define UNIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "unit_config.h" /* the model: UNIT_NAME, UNIT_TOKEN, Model, MODEL(name), numbers of variables */

#define UNIT_REFUSED "There is no memory, or the token is not that of modelDescription.xml."
#define UNIT_TOLERANCE 1e-6 /* of co-simulation where none is given */

typedef enum {
    UNIT_INSTANTIATED,
    UNIT_EVENTS,
    UNIT_CONTINUOUS,
    UNIT_STEPS,
    UNIT_TERMINATED
} UnitMode;

/* All that changes: without pointers, so that a copy of its bytes is a copy of the instance. */
typedef struct {
    Model model;
    double tolerance;
    UnitMode mode;
    bool changed; /* an input or a parameter has been set since the last event */
} UnitState;

typedef void (*UnitCallback)(void);

typedef struct {
    UnitState state;
    bool co_simulation;
    const char *message; /* of the last error */
    void *environment;
    UnitCallback log;
} Unit;

/* A new instance with default values, or NULL. Free it with free(). */
Unit *unit_new(const char *token, bool co_simulation);
void unit_reset(Unit *unit);

/* All that follows returns 0, or 1 and leaves unit->message. */
int unit_refuse(Unit *unit, const char *message);
int unit_setup(Unit *unit, double tolerance, double start);
int unit_begin(Unit *unit);
int unit_enter(Unit *unit, UnitMode mode);

int unit_get(Unit *unit, const uint32_t *references, size_t count, double *values);
int unit_set(Unit *unit, const uint32_t *references, size_t count, const double *values);
int unit_slope(Unit *unit, const uint32_t *unknowns, size_t n_unknowns, const uint32_t *knowns, size_t n_knowns,
               const double *seed, double *sensitivity);

int unit_set_time(Unit *unit, double t);
int unit_set_states(Unit *unit, const double *x, size_t n);
int unit_states(Unit *unit, double *x, size_t n);
int unit_rates(Unit *unit, double *rates, size_t n);
int unit_indicators(Unit *unit, double *indicators, size_t n);
int unit_nominals(Unit *unit, double *nominals, size_t n);
int unit_update(Unit *unit, bool *changed, bool *next_defined, double *next);
int unit_step(Unit *unit, double t, double size);

/* A state is a copy on the heap; *state is allocated where it is NULL. */
int unit_keep(Unit *unit, void **state);
int unit_restore(Unit *unit, const void *state);
size_t unit_state_size(void);
int unit_serialize(Unit *unit, const void *state, void *bytes, size_t size);
int unit_deserialize(Unit *unit, const void *bytes, size_t size, void **state);

#endif
