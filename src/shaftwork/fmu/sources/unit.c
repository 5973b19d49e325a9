/* One instance of a model as FMI wants it: see unit.h. */

#include <math.h>

#include "unit.h"

/* Value references: the time, then parameters, inputs, states, rates, outputs and event indicators. */
enum {
    FIRST_INPUT = 1 + UNIT_PARAMETERS,
    FIRST_STATE = FIRST_INPUT + UNIT_INPUTS,
    FIRST_RATE = FIRST_STATE + UNIT_STATES,
    FIRST_OUTPUT = FIRST_RATE + UNIT_STATES,
    FIRST_INDICATOR = FIRST_OUTPUT + UNIT_OUTPUTS,
    END = FIRST_INDICATOR + UNIT_INDICATORS
};

/* Of each state among all that is stored, where its start value stands. */
static const int UNIT_STORE[] = UNIT_STORES_OF_STATES;

/* Of each output among those of the model. */
static const int UNIT_OUTPUT[] = UNIT_PLACES_OF_OUTPUTS;

/* Room for what is computed: C has no arrays of no elements. */
enum { ROOM = END + 1 };

int unit_refuse(Unit *unit, const char *message)
{
    unit->message = message;
    return 1;
}

static int checked(Unit *unit, int fault)
{
    return fault < 0 ? unit_refuse(unit, MODEL(message)(fault)) : 0;
}

Unit *unit_new(const char *token, bool co_simulation)
{
    Unit *unit;
    if (token == NULL || strcmp(token, UNIT_TOKEN) != 0) {
        return NULL;
    }
    unit = calloc(1, sizeof *unit);
    if (unit != NULL) {
        unit->co_simulation = co_simulation;
        unit_reset(unit);
    }
    return unit;
}

void unit_reset(Unit *unit)
{
    memset(&unit->state, 0, sizeof unit->state); /* the gaps between its fields too, for equal serialised bytes */
    MODEL(init)(&unit->state.model);
    unit->state.tolerance = UNIT_TOLERANCE;
    unit->message = "";
}

int unit_setup(Unit *unit, double tolerance, double start)
{
    unit->state.model.t = start;
    if (tolerance > 0.0) {
        unit->state.tolerance = tolerance;
    }
    return 0;
}

int unit_begin(Unit *unit)
{
    UnitState *state = &unit->state;
    if (checked(unit, MODEL(start)(&state->model, state->model.t))) {
        return 1;
    }
    state->mode = unit->co_simulation ? UNIT_STEPS : UNIT_EVENTS;
    state->changed = false;
    return 0;
}

int unit_enter(Unit *unit, UnitMode mode)
{
    unit->state.mode = mode;
    return 0;
}

/* What follows from time, states, inputs and parameters. Before the start it is that of a copy that has started. */
static int computed(Unit *unit, double *values)
{
    Model copy;
    double outputs[UNIT_ALL_OUTPUTS + 1];
    const Model *model = &unit->state.model;
    if (unit->state.mode == UNIT_INSTANTIATED) {
        copy = unit->state.model;
        if (checked(unit, MODEL(start)(&copy, copy.t))) {
            return 1;
        }
        model = &copy;
    }
    memcpy(&values[FIRST_STATE], model->x, UNIT_STATES * sizeof(double));
    MODEL(rhs)(model, model->t, model->x, &values[FIRST_RATE]);
    MODEL(outputs)(model, model->t, model->x, outputs);
    for (int i = 0; i < UNIT_OUTPUTS; i++) {
        values[FIRST_OUTPUT + i] = outputs[UNIT_OUTPUT[i]];
    }
    MODEL(guards)(model, model->t, model->x, &values[FIRST_INDICATOR]);
    return 0;
}

int unit_get(Unit *unit, const uint32_t *references, size_t count, double *values)
{
    double all[ROOM];
    bool ready = false;
    const Model *model = &unit->state.model;
    for (size_t i = 0; i < count; i++) {
        const uint32_t k = references[i];
        if (k >= END) {
            return unit_refuse(unit, "There is no variable of this value reference.");
        }
        if (k >= FIRST_STATE && !ready) {
            if (computed(unit, all)) {
                return 1;
            }
            ready = true;
        }
        values[i] = k == 0 ? model->t : k < FIRST_INPUT ? model->p[k - 1] : k < FIRST_STATE ? model->u[k - FIRST_INPUT] : all[k];
    }
    return 0;
}

int unit_set(Unit *unit, const uint32_t *references, size_t count, const double *values)
{
    Model *model = &unit->state.model;
    for (size_t i = 0; i < count; i++) {
        const uint32_t k = references[i];
        if (!isfinite(values[i])) {
            return unit_refuse(unit, "A value is not finite.");
        }
        if (k == 0 || k >= FIRST_RATE) {
            return unit_refuse(unit, "A variable of this value reference cannot be set.");
        }
        if (k >= FIRST_STATE) {
            if (unit->co_simulation && unit->state.mode != UNIT_INSTANTIATED) {
                return unit_refuse(unit, "States of co-simulation can be set before the start alone.");
            }
            if (unit->state.mode == UNIT_INSTANTIATED) {
                model->start[UNIT_STORE[k - FIRST_STATE]] = values[i];
            }
            model->x[k - FIRST_STATE] = values[i];
        } else if (k >= FIRST_INPUT) {
            model->u[k - FIRST_INPUT] = values[i];
        } else {
            model->p[k - 1] = values[i];
        }
        unit->state.changed = true;
    }
    return 0;
}

/* Where a variable that can be moved stands; NULL of all others. */
static double *place(Model *model, uint32_t k)
{
    if (k == 0 || k >= FIRST_RATE) {
        return NULL;
    }
    return k < FIRST_INPUT ? &model->p[k - 1] : k < FIRST_STATE ? &model->u[k - FIRST_INPUT] : &model->x[k - FIRST_STATE];
}

/* The rates along a direction of the states, by the Jacobian. */
static int exact_slope(Unit *unit, const uint32_t *unknowns, size_t n_unknowns, const uint32_t *knowns, size_t n_knowns,
                       const double *seed, double *sensitivity)
{
    const Model *model = &unit->state.model;
    double *slopes = malloc((size_t)UNIT_STATES * UNIT_STATES * sizeof *slopes);
    if (slopes == NULL) {
        return unit_refuse(unit, "There is no memory for a Jacobian.");
    }
    MODEL(jacobian)(model, model->t, model->x, slopes);
    for (size_t i = 0; i < n_unknowns; i++) {
        const double *row = &slopes[(unknowns[i] - FIRST_RATE) * UNIT_STATES];
        sensitivity[i] = 0.0;
        for (size_t j = 0; j < n_knowns; j++) {
            sensitivity[i] += row[knowns[j] - FIRST_STATE] * seed[j];
        }
    }
    free(slopes);
    return 0;
}

int unit_slope(Unit *unit, const uint32_t *unknowns, size_t n_unknowns, const uint32_t *knowns, size_t n_knowns,
               const double *seed, double *sensitivity)
{
    const double relative = 6e-6; /* the cube root of the rounding: a central difference is then good to 10 digits */
    const UnitState before = unit->state;
    double values[2][ROOM], step = HUGE_VAL;
    bool exact = true;
    int failed = 0;
    for (size_t j = 0; j < n_knowns; j++) {
        const double *moved = place(&unit->state.model, knowns[j]);
        if (moved == NULL) {
            return unit_refuse(unit, "There are no derivatives by a variable that follows from others.");
        }
        exact = exact && knowns[j] >= FIRST_STATE;
        if (seed[j] != 0.0) {
            step = fmin(step, relative * fmax(1.0, fabs(*moved)) / fabs(seed[j]));
        }
    }
    for (size_t i = 0; i < n_unknowns; i++) {
        if (unknowns[i] >= END || unknowns[i] < FIRST_STATE) {
            return unit_refuse(unit, "There are derivatives of rates, outputs and event indicators alone.");
        }
        exact = exact && unknowns[i] >= FIRST_RATE && unknowns[i] < FIRST_OUTPUT;
        sensitivity[i] = 0.0;
    }
    if (exact && unit->state.mode != UNIT_INSTANTIATED) {
        return exact_slope(unit, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
    }
    if (step == HUGE_VAL) {
        return 0;
    }
    for (int side = 0; side < 2 && !failed; side++) {
        for (size_t j = 0; j < n_knowns; j++) {
            *place(&unit->state.model, knowns[j]) += (side == 0 ? -step : step) * seed[j];
        }
        failed = computed(unit, values[side]);
        unit->state = before;
    }
    for (size_t i = 0; i < n_unknowns && !failed; i++) {
        sensitivity[i] = (values[1][unknowns[i]] - values[0][unknowns[i]]) / (2.0 * step);
    }
    return failed;
}

int unit_set_time(Unit *unit, double t)
{
    unit->state.model.t = t;
    return 0;
}

static int wrong_size(Unit *unit, size_t n, size_t size)
{
    return n == size ? 0 : unit_refuse(unit, "A vector has the wrong length.");
}

int unit_set_states(Unit *unit, const double *x, size_t n)
{
    if (wrong_size(unit, n, UNIT_STATES)) {
        return 1;
    }
    memcpy(unit->state.model.x, x, n * sizeof *x);
    return 0;
}

int unit_states(Unit *unit, double *x, size_t n)
{
    if (wrong_size(unit, n, UNIT_STATES)) {
        return 1;
    }
    memcpy(x, unit->state.model.x, n * sizeof *x);
    return 0;
}

int unit_rates(Unit *unit, double *rates, size_t n)
{
    const Model *model = &unit->state.model;
    if (wrong_size(unit, n, UNIT_STATES)) {
        return 1;
    }
    MODEL(rhs)(model, model->t, model->x, rates);
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(rates[i])) {
            return unit_refuse(unit, "A rate is not finite at these states.");
        }
    }
    return 0;
}

int unit_indicators(Unit *unit, double *indicators, size_t n)
{
    const Model *model = &unit->state.model;
    if (wrong_size(unit, n, UNIT_INDICATORS)) {
        return 1;
    }
    MODEL(guards)(model, model->t, model->x, indicators);
    return 0;
}

int unit_nominals(Unit *unit, double *nominals, size_t n)
{
    static const double nominal[] = UNIT_NOMINALS;
    if (wrong_size(unit, n, UNIT_STATES)) {
        return 1;
    }
    memcpy(nominals, nominal, n * sizeof *nominals);
    return 0;
}

/* What happens now, with the guard that is farthest beyond its limit as the one that has been met. */
static int event(Model *model)
{
    double indicators[UNIT_INDICATORS + 1];
    double most = 0.0;
    MODEL(guards)(model, model->t, model->x, indicators);
    model->met = -1;
    for (int i = 0; i < UNIT_INDICATORS; i++) {
        if (indicators[i] > most) {
            most = indicators[i];
            model->met = i;
        }
    }
    return MODEL(event)(model);
}

int unit_update(Unit *unit, bool *changed, bool *next_defined, double *next)
{
    Model *model = &unit->state.model;
    const int what = event(model);
    *changed = what > 0 && (what & MODEL(STATES_CHANGED)) != 0;
    *next = model->next;
    *next_defined = isfinite(model->next);
    unit->state.changed = false;
    return checked(unit, what);
}

/* On to a time with all events; where there are no states nothing is integrated, and laws of time jump. */
static int advance(Model *model, double end, double tolerance)
{
    int what = 0;
    if (UNIT_STATES > 0) {
        return MODEL(integrate)(model, end, tolerance);
    }
    while (model->next <= end && what >= 0) {
        model->t = model->next;
        what = event(model);
    }
    model->t = end;
    return what;
}

int unit_step(Unit *unit, double t, double size)
{
    Model *model = &unit->state.model;
    const double end = t + size;
    if (fabs(model->t - t) > 1e-9 * (fabs(t) + size)) {
        return unit_refuse(unit, "A step must begin where the last one ended.");
    }
    if (!(size > 0.0)) {
        return unit_refuse(unit, "The size of a step must be positive.");
    }
    if (unit->state.changed && checked(unit, event(model))) {
        return 1;
    }
    unit->state.changed = false;
    return checked(unit, advance(model, end, unit->state.tolerance));
}

int unit_keep(Unit *unit, void **state)
{
    if (*state == NULL && (*state = malloc(sizeof unit->state)) == NULL) {
        return unit_refuse(unit, "There is no memory for a state.");
    }
    memcpy(*state, &unit->state, sizeof unit->state);
    return 0;
}

int unit_restore(Unit *unit, const void *state)
{
    if (state == NULL) {
        return unit_refuse(unit, "There is no such state.");
    }
    memcpy(&unit->state, state, sizeof unit->state);
    return 0;
}

size_t unit_state_size(void)
{
    return sizeof(UnitState);
}

int unit_serialize(Unit *unit, const void *state, void *bytes, size_t size)
{
    if (state == NULL || size < sizeof unit->state) {
        return unit_refuse(unit, "There is no such state, or no room for its bytes.");
    }
    memcpy(bytes, state, sizeof unit->state);
    return 0;
}

int unit_deserialize(Unit *unit, const void *bytes, size_t size, void **state)
{
    if (size != sizeof unit->state) {
        return unit_refuse(unit, "The bytes are not those of a state of this FMU.");
    }
    if (*state == NULL && (*state = malloc(sizeof unit->state)) == NULL) {
        return unit_refuse(unit, "There is no memory for a state.");
    }
    memcpy(*state, bytes, sizeof unit->state);
    return 0;
}
