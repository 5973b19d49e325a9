/* The functions of FMI 3.0 over those of unit.h. */

#include "unit.h"

#define FMI(name) fmi3##name
#define VERSION "3.0"
#define TYPE "Float64"
typedef bool Boolean;
typedef const char *Text;

#include "unit_api.inc"

typedef void (*Log)(void *, Status, const char *, const char *);

static void logged(UnitCallback log, void *environment, const char *message)
{
    if (log != NULL) {
        ((Log)log)(environment, STATUS_ERROR, "logStatusError", message);
    }
}

/* All variables are scalars. */
static int wrong_size(Unit *unit, size_t n, size_t count)
{
    return n == count ? 0 : unit_refuse(unit, "There must be as many values as value references.");
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Log log)
{
    (void)name; (void)resources; (void)visible; (void)logging;
    return instance(token, false, environment, (UnitCallback)log);
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const uint32_t needed[], size_t count,
                                         void *environment, Log log, UnitCallback update)
{
    (void)name; (void)resources; (void)visible; (void)logging; (void)early; (void)needed; (void)count; (void)update;
    if (events) {
        return NULL; /* modelDescription.xml says hasEventMode = false */
    }
    return instance(token, true, environment, (UnitCallback)log);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Log log, UnitCallback update,
                                               UnitCallback lock, UnitCallback unlock)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
    (void)update; (void)lock; (void)unlock;
    return NULL;
}

EXPORT Status fmi3EnterInitializationMode(void *c, bool has_tolerance, double tolerance, double start, bool has_stop,
                                          double stop)
{
    (void)has_stop; (void)stop;
    return status(c, unit_setup(c, has_tolerance ? tolerance : 0.0, start));
}

EXPORT Status fmi3EnterStepMode(void *c) { return status(c, unit_enter(c, UNIT_STEPS)); }

EXPORT Status fmi3GetFloat64(void *c, const uint32_t references[], size_t count, double values[], size_t n)
{
    return status(c, wrong_size(c, n, count) || unit_get(c, references, count, values));
}

EXPORT Status fmi3SetFloat64(void *c, const uint32_t references[], size_t count, const double values[], size_t n)
{
    return status(c, wrong_size(c, n, count) || unit_set(c, references, count, values));
}

/* There are no variables of other types. */
#define NO_TYPE(KIND, CTYPE) \
    NONE(Get##KIND, CTYPE v[], size_t n) \
    NONE(Set##KIND, const CTYPE v[], size_t n)

NO_TYPE(Float32, float)
NO_TYPE(Int8, int8_t)
NO_TYPE(UInt8, uint8_t)
NO_TYPE(Int16, int16_t)
NO_TYPE(UInt16, uint16_t)
NO_TYPE(Int32, int32_t)
NO_TYPE(UInt32, uint32_t)
NO_TYPE(Int64, int64_t)
NO_TYPE(UInt64, uint64_t)
NO_TYPE(Boolean, bool)
NO_TYPE(String, Text)
NONE(GetBinary, size_t s[], const uint8_t *v[], size_t n)
NONE(SetBinary, const size_t s[], const uint8_t *const v[], size_t n)
NONE(GetClock, bool v[])
NONE(SetClock, const bool v[])
NONE(GetIntervalDecimal, double v[], int q[])
NONE(GetIntervalFraction, uint64_t v[], uint64_t s[], int q[])
NONE(GetShiftDecimal, double v[])
NONE(GetShiftFraction, uint64_t v[], uint64_t s[])
NONE(SetIntervalDecimal, const double v[])
NONE(SetIntervalFraction, const uint64_t v[], const uint64_t s[])
NONE(SetShiftDecimal, const double v[])
NONE(SetShiftFraction, const uint64_t v[], const uint64_t s[])
NONE(GetOutputDerivatives, const int32_t o[], double v[], size_t n)

#define REFUSED(FUNCTION, ...) \
    EXPORT Status FUNCTION(__VA_ARGS__) \
    { \
        return status(c, unit_refuse(c, #FUNCTION " is not offered, as modelDescription.xml says.")); \
    }
REFUSED(fmi3GetNumberOfVariableDependencies, void *c, uint32_t r, size_t *n)
REFUSED(fmi3GetVariableDependencies, void *c, uint32_t r, size_t e[], uint32_t i[], size_t k[],
        int kinds[], size_t n)
REFUSED(fmi3GetAdjointDerivative, void *c, const uint32_t u[], size_t nu, const uint32_t k[],
        size_t nk, const double s[], size_t ns, double r[], size_t nr)
REFUSED(fmi3EnterConfigurationMode, void *c)
REFUSED(fmi3ExitConfigurationMode, void *c)
REFUSED(fmi3ActivateModelPartition, void *c, uint32_t r, double t)

EXPORT Status fmi3GetDirectionalDerivative(void *c, const uint32_t unknowns[], size_t n_unknowns,
                                           const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                                           double sensitivity[], size_t n_sensitivity)
{
    return status(c, wrong_size(c, n_seed, n_knowns) || wrong_size(c, n_sensitivity, n_unknowns)
                      || unit_slope(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

EXPORT Status fmi3EvaluateDiscreteStates(void *c) { (void)c; return STATUS_OK; }

EXPORT Status fmi3UpdateDiscreteStates(void *c, bool *again, bool *terminate, bool *nominals, bool *values,
                                       bool *next_defined, double *next)
{
    bool changed = false;
    Status result = status(c, unit_update(c, &changed, next_defined, next));
    *again = *terminate = *nominals = false;
    *values = changed;
    return result;
}

EXPORT Status fmi3GetNumberOfEventIndicators(void *c, size_t *n)
{
    (void)c;
    *n = UNIT_INDICATORS;
    return STATUS_OK;
}

EXPORT Status fmi3GetNumberOfContinuousStates(void *c, size_t *n)
{
    (void)c;
    *n = UNIT_STATES;
    return STATUS_OK;
}

EXPORT Status fmi3DoStep(void *c, double time, double size, bool no_set, bool *event, bool *terminate, bool *early,
                         double *reached)
{
    Unit *unit = c;
    Status result;
    (void)no_set;
    *event = *terminate = *early = false;
    result = status(c, unit_step(unit, time, size));
    *reached = unit->state.model.t;
    return result;
}
