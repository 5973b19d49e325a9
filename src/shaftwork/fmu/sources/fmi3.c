/* The functions of FMI 3.0 over those of unit.h. The interface is that of the Modelica Association's standard. */

#include "unit.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef void *fmi3Environment;
typedef void *fmi3State;
typedef uint32_t fmi3Reference;
typedef const char *fmi3String;
typedef void (*fmi3Log)(fmi3Environment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3Callback)(void);

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

static void logged(const Unit *unit, const char *message)
{
    if (unit->log != NULL) {
        ((fmi3Log)unit->log)(unit->environment, fmi3Error, "logStatusError", message);
    }
}

static fmi3Status status(Unit *unit, int failed)
{
    if (failed) {
        logged(unit, unit->message);
        return fmi3Error;
    }
    return fmi3OK;
}

/* All variables are scalars. */
static int wrong_size(Unit *unit, size_t n, size_t count)
{
    return n == count ? 0 : unit_refuse(unit, "There must be as many values as value references.");
}

static fmi3Instance instance(fmi3String token, bool co_simulation, fmi3Environment environment, fmi3Log log)
{
    Unit *unit = unit_new(token, co_simulation);
    if (unit == NULL) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError", UNIT_REFUSED);
        }
        return NULL;
    }
    unit->environment = environment;
    unit->log = (UnitCallback)log;
    return unit;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                                 bool logging, fmi3Environment environment, fmi3Log log)
{
    (void)name; (void)resources; (void)visible; (void)logging;
    return instance(token, false, environment, log);
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                                bool logging, bool events, bool early, const fmi3Reference needed[],
                                                size_t count, fmi3Environment environment, fmi3Log log,
                                                fmi3Callback update)
{
    (void)name; (void)resources; (void)visible; (void)logging; (void)early; (void)needed; (void)count; (void)update;
    if (events) {
        return NULL; /* modelDescription.xml says hasEventMode = false */
    }
    return instance(token, true, environment, log);
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                      bool visible, bool logging, fmi3Environment environment,
                                                      fmi3Log log, fmi3Callback update, fmi3Callback lock,
                                                      fmi3Callback unlock)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
    (void)update; (void)lock; (void)unlock;
    return NULL;
}

EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t count, const fmi3String categories[])
{
    (void)c; (void)on; (void)count; (void)categories;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance, double start,
                                              bool has_stop, double stop)
{
    (void)has_stop; (void)stop;
    return status(c, unit_setup(c, has_tolerance ? tolerance : 0.0, start));
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return status(c, unit_begin(c)); }
EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c) { return status(c, unit_enter(c, UNIT_EVENTS)); }
EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return status(c, unit_enter(c, UNIT_CONTINUOUS)); }
EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) { return status(c, unit_enter(c, UNIT_STEPS)); }
EXPORT fmi3Status fmi3Terminate(fmi3Instance c) { return status(c, unit_enter(c, UNIT_TERMINATED)); }
EXPORT fmi3Status fmi3Reset(fmi3Instance c) { unit_reset(c); return fmi3OK; }

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3Reference references[], size_t count, double values[],
                                 size_t n)
{
    return status(c, wrong_size(c, n, count) || unit_get(c, references, count, values));
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3Reference references[], size_t count,
                                 const double values[], size_t n)
{
    return status(c, wrong_size(c, n, count) || unit_set(c, references, count, values));
}

/* There are no variables of other types. */
#define NONE(FUNCTION, ...) \
    EXPORT fmi3Status FUNCTION(__VA_ARGS__) \
    { \
        return count == 0 ? fmi3OK : status(c, unit_refuse(c, "This FMU has variables of the type Float64 alone.")); \
    }
#define NO_TYPE(TYPE, CTYPE) \
    NONE(fmi3Get##TYPE, fmi3Instance c, const fmi3Reference r[], size_t count, CTYPE v[], size_t n) \
    NONE(fmi3Set##TYPE, fmi3Instance c, const fmi3Reference r[], size_t count, const CTYPE v[], size_t n)

#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
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
NO_TYPE(String, fmi3String)
NONE(fmi3GetBinary, fmi3Instance c, const fmi3Reference r[], size_t count, size_t s[], const uint8_t *v[], size_t n)
NONE(fmi3SetBinary, fmi3Instance c, const fmi3Reference r[], size_t count, const size_t s[],
     const uint8_t *const v[], size_t n)
NONE(fmi3GetClock, fmi3Instance c, const fmi3Reference r[], size_t count, bool v[])
NONE(fmi3SetClock, fmi3Instance c, const fmi3Reference r[], size_t count, const bool v[])
NONE(fmi3GetIntervalDecimal, fmi3Instance c, const fmi3Reference r[], size_t count, double v[], int q[])
NONE(fmi3GetIntervalFraction, fmi3Instance c, const fmi3Reference r[], size_t count, uint64_t v[], uint64_t s[], int q[])
NONE(fmi3GetShiftDecimal, fmi3Instance c, const fmi3Reference r[], size_t count, double v[])
NONE(fmi3GetShiftFraction, fmi3Instance c, const fmi3Reference r[], size_t count, uint64_t v[], uint64_t s[])
NONE(fmi3SetIntervalDecimal, fmi3Instance c, const fmi3Reference r[], size_t count, const double v[])
NONE(fmi3SetIntervalFraction, fmi3Instance c, const fmi3Reference r[], size_t count, const uint64_t v[],
     const uint64_t s[])
NONE(fmi3SetShiftDecimal, fmi3Instance c, const fmi3Reference r[], size_t count, const double v[])
NONE(fmi3SetShiftFraction, fmi3Instance c, const fmi3Reference r[], size_t count, const uint64_t v[],
     const uint64_t s[])
NONE(fmi3GetOutputDerivatives, fmi3Instance c, const fmi3Reference r[], size_t count, const int32_t o[], double v[],
     size_t n)

#define REFUSED(FUNCTION, ...) \
    EXPORT fmi3Status FUNCTION(__VA_ARGS__) \
    { \
        return status(c, unit_refuse(c, #FUNCTION " is not offered, as modelDescription.xml says.")); \
    }
REFUSED(fmi3GetNumberOfVariableDependencies, fmi3Instance c, fmi3Reference r, size_t *n)
REFUSED(fmi3GetVariableDependencies, fmi3Instance c, fmi3Reference r, size_t e[], fmi3Reference i[], size_t k[],
        int kinds[], size_t n)
REFUSED(fmi3GetAdjointDerivative, fmi3Instance c, const fmi3Reference u[], size_t nu, const fmi3Reference k[],
        size_t nk, const double s[], size_t ns, double r[], size_t nr)
REFUSED(fmi3EnterConfigurationMode, fmi3Instance c)
REFUSED(fmi3ExitConfigurationMode, fmi3Instance c)
REFUSED(fmi3ActivateModelPartition, fmi3Instance c, fmi3Reference r, double t)

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3State *state) { return status(c, unit_keep(c, state)); }
EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3State state) { return status(c, unit_restore(c, state)); }

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3State *state)
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3State state, size_t *size)
{
    (void)c; (void)state;
    *size = unit_state_size();
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3State state, uint8_t bytes[], size_t size)
{
    return status(c, unit_serialize(c, state, bytes, size));
}

EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t bytes[], size_t size, fmi3State *state)
{
    return status(c, unit_deserialize(c, bytes, size, state));
}

EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3Reference unknowns[], size_t n_unknowns,
                                               const fmi3Reference knowns[], size_t n_knowns, const double seed[],
                                               size_t n_seed, double sensitivity[], size_t n_sensitivity)
{
    return status(c, wrong_size(c, n_seed, n_knowns) || wrong_size(c, n_sensitivity, n_unknowns)
                      || unit_slope(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { (void)c; return fmi3OK; }

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *again, bool *terminate, bool *nominals, bool *values,
                                           bool *next_defined, double *next)
{
    bool changed = false;
    fmi3Status result = status(c, unit_update(c, &changed, next_defined, next));
    *again = *terminate = *nominals = false;
    *values = changed;
    return result;
}

EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, bool no_set, bool *event, bool *terminate)
{
    (void)c; (void)no_set;
    *event = *terminate = false;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetTime(fmi3Instance c, double time) { return status(c, unit_set_time(c, time)); }

EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const double x[], size_t n)
{
    return status(c, unit_set_states(c, x, n));
}

EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, double rates[], size_t n)
{
    return status(c, unit_rates(c, rates, n));
}

EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance c, double indicators[], size_t n)
{
    return status(c, unit_indicators(c, indicators, n));
}

EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance c, double x[], size_t n)
{
    return status(c, unit_states(c, x, n));
}

EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, double nominals[], size_t n)
{
    return status(c, unit_nominals(c, nominals, n));
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n)
{
    (void)c;
    *n = UNIT_INDICATORS;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n)
{
    (void)c;
    *n = UNIT_STATES;
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, double time, double size, bool no_set, bool *event, bool *terminate,
                             bool *early, double *reached)
{
    Unit *unit = c;
    fmi3Status result;
    (void)no_set;
    *event = *terminate = *early = false;
    result = status(c, unit_step(unit, time, size));
    *reached = unit->state.model.t;
    return result;
}
