/* The functions of FMI 2.0 over those of unit.h. The interface is that of the Modelica Association's standard. */

#include "unit.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef void *fmi2Component;
typedef void *fmi2State;
typedef unsigned int fmi2Reference;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef void (*fmi2Log)(void *, fmi2String, fmi2Status, fmi2String, fmi2String, ...);

typedef struct {
    fmi2Log logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, fmi2Status);
    void *environment;
} fmi2Callbacks;

typedef struct {
    fmi2Boolean again;
    fmi2Boolean terminate;
    fmi2Boolean nominals;
    fmi2Boolean values;
    fmi2Boolean next_defined;
    double next;
} fmi2Events;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

static fmi2Status status(Unit *unit, int failed)
{
    if (failed) {
        if (unit->log != NULL) {
            ((fmi2Log)unit->log)(unit->environment, UNIT_NAME, fmi2Error, "logStatusError", "%s", unit->message);
        }
        return fmi2Error;
    }
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, int kind, fmi2String token, fmi2String resources,
                                     const fmi2Callbacks *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    Unit *unit = unit_new(token, kind == 1);
    (void)resources; (void)visible; (void)logging;
    if (unit == NULL) {
        if (callbacks != NULL && callbacks->logger != NULL) {
            callbacks->logger(callbacks->environment, name, fmi2Error, "logStatusError", "%s", UNIT_REFUSED);
        }
        return NULL;
    }
    if (callbacks != NULL) {
        unit->environment = callbacks->environment;
        unit->log = (UnitCallback)callbacks->logger;
    }
    return unit;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c; (void)on; (void)count; (void)categories;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, double tolerance, double start,
                                      fmi2Boolean has_stop, double stop)
{
    (void)has_stop; (void)stop;
    return status(c, unit_setup(c, has_tolerance ? tolerance : 0.0, start));
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return status(c, unit_begin(c)); }
EXPORT fmi2Status fmi2Terminate(fmi2Component c) { return status(c, unit_enter(c, UNIT_TERMINATED)); }
EXPORT fmi2Status fmi2Reset(fmi2Component c) { unit_reset(c); return fmi2OK; }
EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c) { return status(c, unit_enter(c, UNIT_EVENTS)); }
EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return status(c, unit_enter(c, UNIT_CONTINUOUS)); }

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2Reference references[], size_t count, double values[])
{
    return status(c, unit_get(c, references, count, values));
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2Reference references[], size_t count, const double values[])
{
    return status(c, unit_set(c, references, count, values));
}

/* There are no variables of other types. */
#define NONE(FUNCTION, ...) \
    EXPORT fmi2Status FUNCTION(__VA_ARGS__) \
    { \
        return count == 0 ? fmi2OK : status(c, unit_refuse(c, "This FMU has variables of the type Real alone.")); \
    }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NONE(fmi2GetInteger, fmi2Component c, const fmi2Reference r[], size_t count, int v[])
NONE(fmi2SetInteger, fmi2Component c, const fmi2Reference r[], size_t count, const int v[])
NONE(fmi2GetBoolean, fmi2Component c, const fmi2Reference r[], size_t count, fmi2Boolean v[])
NONE(fmi2SetBoolean, fmi2Component c, const fmi2Reference r[], size_t count, const fmi2Boolean v[])
NONE(fmi2GetString, fmi2Component c, const fmi2Reference r[], size_t count, fmi2String v[])
NONE(fmi2SetString, fmi2Component c, const fmi2Reference r[], size_t count, const fmi2String v[])
NONE(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2Reference r[], size_t count, const int o[],
     const double v[])
NONE(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2Reference r[], size_t count, const int o[], double v[])

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2State *state) { return status(c, unit_keep(c, state)); }
EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2State state) { return status(c, unit_restore(c, state)); }

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2State *state)
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2State state, size_t *size)
{
    (void)c; (void)state;
    *size = unit_state_size();
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2State state, char bytes[], size_t size)
{
    return status(c, unit_serialize(c, state, bytes, size));
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const char bytes[], size_t size, fmi2State *state)
{
    return status(c, unit_deserialize(c, bytes, size, state));
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2Reference unknowns[], size_t n_unknowns,
                                               const fmi2Reference knowns[], size_t n_knowns, const double seed[],
                                               double sensitivity[])
{
    return status(c, unit_slope(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2Events *events)
{
    bool changed = false;
    bool defined = false;
    fmi2Status result = status(c, unit_update(c, &changed, &defined, &events->next));
    events->again = events->terminate = events->nominals = 0;
    events->values = changed;
    events->next_defined = defined;
    return result;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set, fmi2Boolean *event,
                                              fmi2Boolean *terminate)
{
    (void)c; (void)no_set;
    *event = *terminate = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetTime(fmi2Component c, double time) { return status(c, unit_set_time(c, time)); }

EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const double x[], size_t n)
{
    return status(c, unit_set_states(c, x, n));
}

EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, double rates[], size_t n)
{
    return status(c, unit_rates(c, rates, n));
}

EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, double indicators[], size_t n)
{
    return status(c, unit_indicators(c, indicators, n));
}

EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, double x[], size_t n)
{
    return status(c, unit_states(c, x, n));
}

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, double nominals[], size_t n)
{
    return status(c, unit_nominals(c, nominals, n));
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, double time, double size, fmi2Boolean no_set)
{
    (void)no_set;
    return status(c, unit_step(c, time, size));
}

/* A step is never left unfinished. */
EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    return status(c, unit_refuse(c, "There is no step to cancel: doStep returns when it is done."));
}

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, int kind, fmi2Status *value)
{
    (void)c; (void)kind;
    *value = fmi2OK;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, int kind, double *value)
{
    (void)kind;
    *value = ((Unit *)c)->state.model.t;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, int kind, int *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, int kind, fmi2Boolean *value)
{
    (void)c; (void)kind;
    *value = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, int kind, fmi2String *value)
{
    (void)c; (void)kind;
    *value = "";
    return fmi2Discard;
}
