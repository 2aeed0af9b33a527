/* The functions of FMI 3.0 for co-simulation. The headers are those of the standard. */

#include "fmi3Functions.h"
#include "unit.h"

#define STATUS(done) ((done) ? fmi3OK : fmi3Error)
#define REQUIRE(phases)                                                                                               \
    if (!unit_allowed(c, phases, __func__))                                                                           \
    return fmi3Error

static void log_error(struct instance *c, const char *text)
{
    if (c->logger)
        ((fmi3LogMessageCallback)c->logger)(c->environment, fmi3Error, "logStatusError", text);
}

/* An instance that is not made, and why. */
static fmi3Instance refused(fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger, const char *why)
{
    struct instance early = {.environment = environment, .logger = (void (*)(void))logger};
    log_error(&early, why);
    return NULL;
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    REQUIRE(ANY_PHASE); /* only errors are logged, and they always are */
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update)
{
    if (events)
        return refused(environment, logger, "this unit has no event mode");
    if (intermediate_count)
        return refused(environment, logger, "this unit gives no intermediate values");
    return unit_make(name, token, log_error, environment, (void (*)(void))logger);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger)
{
    return refused(environment, logger, "this unit is for co-simulation only");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    return refused(environment, logger, "this unit is for co-simulation only");
}

void fmi3FreeInstance(fmi3Instance c)
{
    if (unit_allowed(c, ANY_PHASE, __func__))
        unit_free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stops, fmi3Float64 stop)
{
    struct instance *c = instance;
    REQUIRE(INSTANTIATED);
    if (!unit_begin(c, start, stops, stop))
        return fmi3Error;
    c->clock[PHASE] = INITIALISING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    struct instance *c = instance;
    REQUIRE(INITIALISING);
    if (!unit_settle(c))
        return fmi3Error;
    c->clock[PHASE] = STEPPING;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    struct instance *c = instance;
    REQUIRE(STEPPING);
    c->clock[PHASE] = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    REQUIRE(ANY_PHASE);
    unit_reset(c);
    return fmi3OK;
}

/* Every variable is a scalar: there are as many values as references. */
static int one_each(struct instance *c, size_t references, size_t values)
{
    return references == values || unit_refuse(c, "%lu value references but %lu values", (unsigned long)references,
                                               (unsigned long)values);
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 values[], size_t count)
{
    REQUIRE(ANY_PHASE);
    return STATUS(one_each(c, nvr, count) && unit_get(c, REAL, vr, nvr, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 values[],
                          size_t count)
{
    REQUIRE(ANY_PHASE);
    return STATUS(one_each(c, nvr, count) && unit_set(c, REAL, vr, nvr, values));
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Boolean values[], size_t count)
{
    REQUIRE(ANY_PHASE);
    if (!one_each(c, nvr, count))
        return fmi3Error;
    if (!unit_arrays(c, vr, nvr, values))
        return fmi3Error;
    for (size_t i = 0; i < nvr; i++) {
        double number;
        if (!unit_get(c, BOOLEAN, &vr[i], 1, &number))
            return fmi3Error;
        values[i] = number != 0.0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Boolean values[],
                          size_t count)
{
    REQUIRE(ANY_PHASE);
    if (!one_each(c, nvr, count))
        return fmi3Error;
    if (!unit_arrays(c, vr, nvr, values))
        return fmi3Error;
    for (size_t i = 0; i < nvr; i++)
        if (!unit_settable(c, BOOLEAN, vr[i], values[i] ? 1.0 : 0.0))
            return fmi3Error;
    for (size_t i = 0; i < nvr; i++)
        unit_set(c, BOOLEAN, &vr[i], 1, &(double){values[i] ? 1.0 : 0.0});
    return fmi3OK;
}

/* There are no variables of the other types. */
static fmi3Status none_of_type(fmi3Instance c, size_t count, const char *function)
{
    if (!unit_allowed(c, ANY_PHASE, function))
        return fmi3Error;
    return count ? STATUS(unit_refuse(c, "%s: this unit has no variables of this type", function)) : fmi3OK;
}

#define NONE_OF(name)                                                                                                 \
    fmi3Status fmi3Get##name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3##name values[],          \
                             size_t count)                                                                            \
    {                                                                                                                 \
        return none_of_type(c, nvr, __func__);                                                                        \
    }                                                                                                                 \
    fmi3Status fmi3Set##name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3##name values[],    \
                             size_t count)                                                                            \
    {                                                                                                                 \
        return none_of_type(c, nvr, __func__);                                                                        \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(Int32)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, size_t sizes[],
                         fmi3Binary values[], size_t count)
{
    return none_of_type(c, nvr, __func__);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const size_t sizes[],
                         const fmi3Binary values[], size_t count)
{
    return none_of_type(c, nvr, __func__);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Clock values[])
{
    return none_of_type(c, nvr, __func__);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Clock values[])
{
    return none_of_type(c, nvr, __func__);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_keep(c, (struct snapshot **)state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_restore(c, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_forget(c, (struct snapshot **)state));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    REQUIRE(ANY_PHASE);
    if (!unit_place(c, size))
        return fmi3Error;
    *size = unit_stored_size(c); /* all have one size */
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_store(c, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_load(c, bytes, size, (struct snapshot **)state));
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_return,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    REQUIRE(STEPPING);
    if (!event_needed || !terminate || !early || !reached)
        return STATUS(unit_refuse(c, "fmi3DoStep has no place for what it returns"));
    int done = unit_step(c, time, size);
    *event_needed = *terminate = *early = fmi3False;
    *reached = unit_time(c);
    return STATUS(done);
}

/* What the description says that this unit does not offer. */
static fmi3Status not_offered(fmi3Instance c, const char *function)
{
    if (unit_allowed(c, ANY_PHASE, function))
        unit_refuse(c, "this unit does not offer %s", function);
    return fmi3Error;
}

#define NOT_OFFERED(name, ...)                                                                                        \
    fmi3Status name(fmi3Instance c, ##__VA_ARGS__)                                                                    \
    {                                                                                                                 \
        return not_offered(c, __func__);                                                                              \
    }

NOT_OFFERED(fmi3EnterEventMode)
NOT_OFFERED(fmi3EnterStepMode)
NOT_OFFERED(fmi3EnterConfigurationMode)
NOT_OFFERED(fmi3ExitConfigurationMode)
NOT_OFFERED(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3UpdateDiscreteStates, fmi3Boolean *needed, fmi3Boolean *terminate, fmi3Boolean *nominals,
            fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next)
NOT_OFFERED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *count)
NOT_OFFERED(fmi3GetVariableDependencies, fmi3ValueReference vr, size_t elements[], fmi3ValueReference independents[],
            size_t of_independents[], fmi3DependencyKind kinds[], size_t count)
NOT_OFFERED(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t unknown_count,
            const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,
            fmi3Float64 result[], size_t result_count)
NOT_OFFERED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t unknown_count,
            const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,
            fmi3Float64 result[], size_t result_count)
NOT_OFFERED(fmi3GetOutputDerivatives, const fmi3ValueReference vr[], size_t nvr, const fmi3Int32 orders[],
            fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetIntervalDecimal, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 intervals[],
            fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetIntervalFraction, const fmi3ValueReference vr[], size_t nvr, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetShiftDecimal, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 shifts[])
NOT_OFFERED(fmi3GetShiftFraction, const fmi3ValueReference vr[], size_t nvr, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetIntervalDecimal, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 intervals[])
NOT_OFFERED(fmi3SetIntervalFraction, const fmi3ValueReference vr[], size_t nvr, const fmi3UInt64 counters[],
            const fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetShiftDecimal, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 shifts[])
NOT_OFFERED(fmi3SetShiftFraction, const fmi3ValueReference vr[], size_t nvr, const fmi3UInt64 counters[],
            const fmi3UInt64 resolutions[])

/* Those of the other kinds of units; some importers look for every function of the standard. */
NOT_OFFERED(fmi3EnterContinuousTimeMode)
NOT_OFFERED(fmi3CompletedIntegratorStep, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *terminate)
NOT_OFFERED(fmi3SetTime, fmi3Float64 time)
NOT_OFFERED(fmi3SetContinuousStates, const fmi3Float64 states[], size_t count)
NOT_OFFERED(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t count)
NOT_OFFERED(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t count)
NOT_OFFERED(fmi3GetContinuousStates, fmi3Float64 states[], size_t count)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t count)
NOT_OFFERED(fmi3GetNumberOfEventIndicators, size_t *count)
NOT_OFFERED(fmi3GetNumberOfContinuousStates, size_t *count)
NOT_OFFERED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
