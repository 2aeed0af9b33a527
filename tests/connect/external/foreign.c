/* A vehicle of somebody else, as a unit of FMI 2.0: a rack on a spring, lateral acceleration and yaw rate in proportion
 * to its travel, in units and signs of its own. Loading it writes the file that STEER_LOADED names. After the time
 * `breaks` it gives NaN, after `ends` it refuses a step. STEER_FAULT, as "step exit 0", names a place and what the
 * unit does there. */

#include "fmi2Functions.h"

#include <math.h>
#include <stdio.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TRAVEL, SPEED, BREAKS, ENDS, FORCE, ACCELERATION, YAW, VELOCITY, X, COUNT };

struct unit {
    double values[COUNT], time;
    fmi2CallbackFunctions callbacks;
};

/* A process that has left the group of this one and has no parent. */
static void leave_a_child(void)
{
    if (fork() == 0) {
        setsid();
        if (fork() == 0)
            for (;;)
                pause();
        _exit(0);
    }
}

static void at(const char *place)
{
    const char *fault = getenv("STEER_FAULT"), *what = fault ? strchr(fault, ' ') + 1 : "";
    if (!fault || strncmp(fault, place, what - fault - 1))
        return;
    if (!strcmp(what, "exit 0"))
        exit(0);
    if (!strcmp(what, "exit 1"))
        exit(1);
    if (!strcmp(what, "abort"))
        abort();
    if (!strcmp(what, "segfault"))
        *(volatile int *)8 = 0;
    if (!strcmp(what, "allocate"))
        for (;;)
            memset(malloc(1 << 24), 1, 1 << 24);
    if (!strcmp(what, "leave a child"))
        leave_a_child();
    if (!strcmp(what, "leave a child and exit"))
        leave_a_child(), exit(0);
    if (!strcmp(what, "fork 32"))
        for (int i = 0; i < 5; i++)
            if (fork() == 0 && i % 2)
                setsid();
    if (!strcmp(what, "stop"))
        raise(SIGSTOP);
    if (!strcmp(what, "scribble"))
        for (int i = 3; i < 256; i++)
            write(i, "\10\0\0\0\0\0\0\0scribble", 16);
    if (!strcmp(what, "close"))
        for (int i = 0; i < 256; i++)
            close(i);
    while (!strcmp(what, "loop") || !strcmp(what, "fork 32"))
        ;
}

__attribute__((destructor)) static void unloaded(void) { at("unload"); }

__attribute__((constructor)) static void loaded(void)
{
    at("load");
    const char *name = getenv("STEER_LOADED");
    FILE *file = name ? fopen(name, "w") : NULL;
    if (file)
        fclose(file);
}

static void fill(struct unit *u)
{
    double travel = u->values[TRAVEL];                         /* mm, positive where it steers right */
    u->values[FORCE] = 0.02 * travel;                          /* kN, positive where it resists a right turn */
    u->values[ACCELERATION] = -0.0625 * travel;                /* g */
    u->values[YAW] = -1.2 * travel;                            /* deg/s */
    u->values[VELOCITY] = u->values[SPEED];                    /* km/h */
    u->values[X] = 5.0 + u->time * u->values[SPEED] / 3.6;     /* m */
    if (u->time > u->values[BREAKS])
        u->values[YAW] = NAN;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String s[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    at("instantiate");
    struct unit *u = callbacks->allocateMemory(1, sizeof *u);
    u->callbacks = *callbacks;
    u->values[SPEED] = 100.0;
    u->values[BREAKS] = u->values[ENDS] = INFINITY;
    return u;
}

void fmi2FreeInstance(fmi2Component c) { at("free"), ((struct unit *)c)->callbacks.freeMemory(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real start, fmi2Boolean e, fmi2Real stop)
{
    return at("setup"), fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fill(c), fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return at("terminate"), fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real value[])
{
    for (size_t i = 0; i < n; i++)
        value[i] = ((struct unit *)c)->values[r[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real value[])
{
    for (size_t i = 0; i < n; i++)
        ((struct unit *)c)->values[r[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no)
{
    struct unit *u = c;
    u->time = time + step;
    at("step");
    if (u->time > u->values[ENDS]) {
        u->callbacks.logger(u->callbacks.componentEnvironment, "vehicle", fmi2Error, "", "it ran out of road at %g m",
                            u->values[X]);
        return fmi2Error;
    }
    fill(u);
    return fmi2OK;
}

#define UNUSED(name, ...)                                                                                             \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return fmi2Error; }
typedef const fmi2ValueReference *references;
UNUSED(fmi2GetInteger, references r, size_t n, fmi2Integer v[])
UNUSED(fmi2GetBoolean, references r, size_t n, fmi2Boolean v[])
UNUSED(fmi2GetString, references r, size_t n, fmi2String v[])
UNUSED(fmi2SetInteger, references r, size_t n, const fmi2Integer v[])
UNUSED(fmi2SetBoolean, references r, size_t n, const fmi2Boolean v[])
UNUSED(fmi2SetString, references r, size_t n, const fmi2String v[])
UNUSED(fmi2GetFMUstate, fmi2FMUstate *s)
UNUSED(fmi2SetFMUstate, fmi2FMUstate s)
UNUSED(fmi2FreeFMUstate, fmi2FMUstate *s)
UNUSED(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
UNUSED(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
UNUSED(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
UNUSED(fmi2GetDirectionalDerivative, references r, size_t n, references k, size_t m, const fmi2Real a[], fmi2Real b[])
UNUSED(fmi2SetRealInputDerivatives, references r, size_t n, const fmi2Integer o[], const fmi2Real v[])
UNUSED(fmi2GetRealOutputDerivatives, references r, size_t n, const fmi2Integer o[], fmi2Real v[])
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
UNUSED(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
UNUSED(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real *v)
UNUSED(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
UNUSED(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *v)
UNUSED(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
