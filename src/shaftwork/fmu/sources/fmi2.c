/* The functions of FMI 2.0 over those of unit.h. */

#include "unit.h"

#define FMI(name) fmi2##name
#define VERSION "2.0"
#define TYPE "Real"
#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SetFMUState fmi2SetFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define fmi2GetContinuousStateDerivatives fmi2GetDerivatives
typedef int Boolean;

#include "unit_api.inc"

typedef void (*Log)(void *, const char *, Status, const char *, const char *, ...);

typedef struct {
    Log logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    Boolean again;
    Boolean terminate;
    Boolean nominals;
    Boolean values;
    Boolean next_defined;
    double next;
} Events;

static void logged(UnitCallback log, void *environment, const char *message)
{
    if (log != NULL) {
        ((Log)log)(environment, UNIT_NAME, STATUS_ERROR, "logStatusError", "%s", message);
    }
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT void *fmi2Instantiate(const char *name, int kind, const char *token, const char *resources,
                             const Callbacks *callbacks, Boolean visible, Boolean logging)
{
    static const Callbacks none;
    const Callbacks *back = callbacks == NULL ? &none : callbacks;
    (void)name; (void)resources; (void)visible; (void)logging;
    return instance(token, kind == 1, back->environment, (UnitCallback)back->logger);
}

EXPORT Status fmi2SetupExperiment(void *c, Boolean has_tolerance, double tolerance, double start, Boolean has_stop,
                                  double stop)
{
    (void)has_stop; (void)stop;
    return status(c, unit_setup(c, has_tolerance ? tolerance : 0.0, start));
}

EXPORT Status fmi2EnterInitializationMode(void *c) { (void)c; return STATUS_OK; }

EXPORT Status fmi2GetReal(void *c, const uint32_t references[], size_t count, double values[])
{
    return status(c, unit_get(c, references, count, values));
}

EXPORT Status fmi2SetReal(void *c, const uint32_t references[], size_t count, const double values[])
{
    return status(c, unit_set(c, references, count, values));
}

/* There are no variables of other types. */
NONE(GetInteger, int v[])
NONE(SetInteger, const int v[])
NONE(GetBoolean, Boolean v[])
NONE(SetBoolean, const Boolean v[])
NONE(GetString, const char *v[])
NONE(SetString, const char *const v[])
NONE(SetRealInputDerivatives, const int o[], const double v[])
NONE(GetRealOutputDerivatives, const int o[], double v[])

EXPORT Status fmi2GetDirectionalDerivative(void *c, const uint32_t unknowns[], size_t n_unknowns,
                                           const uint32_t knowns[], size_t n_knowns, const double seed[],
                                           double sensitivity[])
{
    return status(c, unit_slope(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

EXPORT Status fmi2NewDiscreteStates(void *c, Events *events)
{
    bool changed = false;
    bool defined = false;
    Status result = status(c, unit_update(c, &changed, &defined, &events->next));
    events->again = events->terminate = events->nominals = 0;
    events->values = changed;
    events->next_defined = defined;
    return result;
}

EXPORT Status fmi2DoStep(void *c, double time, double size, Boolean no_set)
{
    (void)no_set;
    return status(c, unit_step(c, time, size));
}

/* A step is never left unfinished. */
EXPORT Status fmi2CancelStep(void *c)
{
    return status(c, unit_refuse(c, "There is no step to cancel: doStep returns when it is done."));
}

EXPORT Status fmi2GetStatus(void *c, int kind, Status *value)
{
    (void)c; (void)kind;
    *value = STATUS_OK;
    return STATUS_OK;
}

EXPORT Status fmi2GetRealStatus(void *c, int kind, double *value)
{
    (void)kind;
    *value = ((Unit *)c)->state.model.t;
    return STATUS_OK;
}

EXPORT Status fmi2GetIntegerStatus(void *c, int kind, int *value)
{
    (void)c; (void)kind; (void)value;
    return STATUS_DISCARD;
}

EXPORT Status fmi2GetBooleanStatus(void *c, int kind, Boolean *value)
{
    (void)c; (void)kind;
    *value = 0;
    return STATUS_OK;
}

EXPORT Status fmi2GetStringStatus(void *c, int kind, const char **value)
{
    (void)c; (void)kind;
    *value = "";
    return STATUS_DISCARD;
}
