/* The functions of FMI 2.0 for co-simulation. The headers are those of the standard. */

#include "fmi2Functions.h"
#include "unit.h"

#define STATUS(done) ((done) ? fmi2OK : fmi2Error)
#define REQUIRE(phases)                                                                                               \
    if (!unit_allowed(c, phases, __func__))                                                                           \
    return fmi2Error

static void log_error(struct instance *c, const char *text)
{
    if (c->logger)
        ((fmi2CallbackLogger)c->logger)(c->environment, c->name, fmi2Error, "logStatusError", "%s", text);
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    /* only errors are logged, and they always are */
    REQUIRE(ANY_PHASE);
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    if (!callbacks || type != fmi2CoSimulation) {
        struct instance early = {.name = (char *)(name ? name : ""), .logger = NULL};
        if (callbacks) {
            early.environment = callbacks->componentEnvironment;
            early.logger = (void (*)(void))callbacks->logger;
        }
        log_error(&early, callbacks ? "this unit is for co-simulation only" : "no callback functions");
        return NULL;
    }
    return unit_make(name, token, log_error, callbacks->componentEnvironment, (void (*)(void))callbacks->logger);
}

void fmi2FreeInstance(fmi2Component c)
{
    if (unit_allowed(c, ANY_PHASE, __func__))
        unit_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stops, fmi2Real stop)
{
    /* the step is fixed */
    REQUIRE(INSTANTIATED);
    return STATUS(unit_begin(c, start, stops, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    struct instance *c = component;
    REQUIRE(INSTANTIATED);
    c->clock[PHASE] = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    struct instance *c = component;
    REQUIRE(INITIALISING);
    if (!unit_settle(c))
        return fmi2Error;
    c->clock[PHASE] = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    struct instance *c = component;
    REQUIRE(STEPPING);
    c->clock[PHASE] = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    REQUIRE(ANY_PHASE);
    unit_reset(c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_get(c, REAL, vr, nvr, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_set(c, REAL, vr, nvr, value));
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    REQUIRE(ANY_PHASE);
    if (!unit_arrays(c, vr, nvr, value))
        return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        double number;
        if (!unit_get(c, BOOLEAN, &vr[i], 1, &number))
            return fmi2Error;
        value[i] = number != 0.0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    REQUIRE(ANY_PHASE);
    if (!unit_arrays(c, vr, nvr, value))
        return fmi2Error;
    for (size_t i = 0; i < nvr; i++)
        if (!unit_settable(c, BOOLEAN, vr[i], value[i] ? 1.0 : 0.0))
            return fmi2Error;
    for (size_t i = 0; i < nvr; i++)
        unit_set(c, BOOLEAN, &vr[i], 1, &(double){value[i] ? 1.0 : 0.0});
    return fmi2OK;
}

/* There are no variables of the other types. */
static fmi2Status none_of_type(fmi2Component c, size_t count, const char *function, const char *type)
{
    if (!unit_allowed(c, ANY_PHASE, function))
        return fmi2Error;
    return count ? STATUS(unit_refuse(c, "%s: this unit has no %s variables", function, type)) : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    return none_of_type(c, nvr, __func__, "integer");
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    return none_of_type(c, nvr, __func__, "integer");
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return none_of_type(c, nvr, __func__, "string");
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return none_of_type(c, nvr, __func__, "string");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_keep(c, (struct snapshot **)state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_restore(c, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_forget(c, (struct snapshot **)state));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    /* all have one size */
    REQUIRE(ANY_PHASE);
    if (!unit_place(c, size))
        return fmi2Error;
    *size = unit_stored_size(c);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_store(c, state, (unsigned char *)bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    REQUIRE(ANY_PHASE);
    return STATUS(unit_load(c, (const unsigned char *)bytes, size, (struct snapshot **)state));
}

/* What the description says that this unit does not offer. */
static fmi2Status not_offered(fmi2Component c, const char *function)
{
    if (unit_allowed(c, ANY_PHASE, function))
        unit_refuse(c, "this unit does not offer %s", function);
    return fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count,
                                        const fmi2Real seed[], fmi2Real result[])
{
    return not_offered(c, __func__);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    return not_offered(c, __func__);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    return not_offered(c, __func__);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_return)
{
    REQUIRE(STEPPING);
    return STATUS(unit_step(c, time, size));
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return not_offered(c, __func__); /* a step is never pending */
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    REQUIRE(STEPPING | TERMINATED);
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    if (!unit_place(c, value))
        return fmi2Error;
    *value = unit_time(c);
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    REQUIRE(STEPPING | TERMINATED);
    if (kind != fmi2Terminated)
        return fmi2Discard;
    if (!unit_place(c, value))
        return fmi2Error;
    *value = fmi2False; /* the unit never ends a simulation */
    return fmi2OK;
}

/* No step is ever pending, so that there is no status of one. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    REQUIRE(STEPPING | TERMINATED);
    return fmi2Discard;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    REQUIRE(STEPPING | TERMINATED);
    return fmi2Discard;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    REQUIRE(STEPPING | TERMINATED);
    return fmi2Discard;
}
