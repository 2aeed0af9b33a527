/* Drives a unit of FMI 3.0 as a C importer does: good and bad calls, snapshots and many instances.
 *
 *   harness3 LIBRARY TOKEN STEPS INSTANCES
 */

#include "fmi3FunctionTypes.h"

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *library;
static char last[512];
static const char *token;

#define F(name) ((name##TYPE *)dlsym(library, #name))
#define EXPECT(condition)                                                                                             \
    do {                                                                                                              \
        if (!(condition)) {                                                                                           \
            printf("line %d: %s; last message: %s\n", __LINE__, #condition, last);                                    \
            exit(1);                                                                                                  \
        }                                                                                                             \
    } while (0)
#define REFUSED(call, text)                                                                                           \
    do {                                                                                                              \
        last[0] = 0;                                                                                                  \
        EXPECT((call) == fmi3Error);                                                                                  \
        EXPECT(strstr(last, text));                                                                                   \
    } while (0)

static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment, (void)status, (void)category;
    snprintf(last, sizeof last, "%s", message);
}

static fmi3Instance made(const char *guid, fmi3Boolean events)
{
    return F(fmi3InstantiateCoSimulation)("unit", guid, "", fmi3False, fmi3False, events, fmi3False, NULL, 0, NULL,
                                          logger, NULL);
}

static fmi3Instance ready(void)
{
    fmi3Instance c = made(token, fmi3False);
    EXPECT(c);
    EXPECT(F(fmi3EnterInitializationMode)(c, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK);
    EXPECT(F(fmi3ExitInitializationMode)(c) == fmi3OK);
    return c;
}

static fmi3Status step(fmi3Instance c, double time, double size)
{
    fmi3Boolean event, end, early;
    fmi3Float64 reached;
    return F(fmi3DoStep)(c, time, size, fmi3True, &event, &end, &early, &reached);
}

static void bad_calls(void)
{
    EXPECT(!made("{0}", fmi3False) && strstr(last, "another binary"));
    EXPECT(!made(token, fmi3True) && strstr(last, "no event mode"));
    EXPECT(F(fmi3Reset)(NULL) == fmi3Error);
    fmi3Instance c = made(token, fmi3False);
    REFUSED(step(c, 0.0, 1e-3), "not allowed before initialization");
    REFUSED(F(fmi3EnterInitializationMode)(c, fmi3False, 0.0, NAN, fmi3False, 0.0), "start time");
    F(fmi3FreeInstance)(c);
    c = ready();
    fmi3ValueReference torque = 0, unknown = 100000;
    fmi3Float64 values[] = {NAN, 1.0};
    fmi3Int32 whole = 0;
    REFUSED(F(fmi3SetFloat64)(c, &torque, 1, values, 1), "hand_torque must be finite");
    REFUSED(F(fmi3SetFloat64)(c, &torque, 1, values, 2), "1 value references but 2 values");
    REFUSED(F(fmi3GetFloat64)(c, &unknown, 1, values, 1), "value reference 100000");
    REFUSED(F(fmi3GetInt32)(c, &torque, 1, &whole, 1), "no variables of this type");
    REFUSED(F(fmi3SetBoolean)(c, &torque, 1, NULL, 1), "no array");
    REFUSED(F(fmi3GetBoolean)(c, &torque, 1, NULL, 1), "no array");
    REFUSED(F(fmi3DoStep)(c, 0.0, 1e-3, fmi3True, NULL, NULL, NULL, NULL), "no place for what it returns");
    values[0] = -201.0;
    REFUSED(F(fmi3SetFloat64)(c, &torque, 1, values, 1), "hand_torque must be at least -200, got -201");
    REFUSED(F(fmi3GetFloat64)(c, NULL, 1, values, 1), "no array");
    REFUSED(F(fmi3GetFMUState)(c, NULL), "no place");
    REFUSED(F(fmi3SerializedFMUStateSize)(c, NULL, NULL), "no place");
    REFUSED(F(fmi3EnterStepMode)(c), "does not offer fmi3EnterStepMode");
    REFUSED(step(c, 0.0, 0.0), "must be positive");
    REFUSED(step(c, 0.0, 1.5e-3), "whole number of milliseconds");
    REFUSED(step(c, 0.5, 1e-3), "but the unit is at 0 s");
    EXPECT(step(c, 0.0, 2e-3) == fmi3OK);
    EXPECT(F(fmi3Terminate)(c) == fmi3OK);
    REFUSED(step(c, 2e-3, 1e-3), "after termination");
    EXPECT(F(fmi3Reset)(c) == fmi3OK);
    F(fmi3FreeInstance)(c);
}

static void snapshots(long steps)
{
    fmi3Instance a = ready(), b = ready();
    fmi3FMUState kept = NULL, loaded = NULL;
    fmi3ValueReference torque = 0;
    fmi3Float64 push = 2.0;
    size_t size = 0;
    EXPECT(F(fmi3SetFloat64)(a, &torque, 1, &push, 1) == fmi3OK);
    for (long i = 0; i < steps; i++)
        EXPECT(step(a, 1e-3 * (double)i, 1e-3) == fmi3OK);
    EXPECT(F(fmi3GetFMUState)(a, &kept) == fmi3OK);
    EXPECT(F(fmi3SerializedFMUStateSize)(a, kept, &size) == fmi3OK);
    fmi3Byte *bytes = malloc(size), *again = malloc(size);
    EXPECT(F(fmi3SerializeFMUState)(a, kept, bytes, size) == fmi3OK);
    REFUSED(F(fmi3SetFMUState)(b, kept), "none of this instance");
    REFUSED(F(fmi3DeserializeFMUState)(b, bytes, size - 1, &loaded), "bytes");
    EXPECT(F(fmi3DeserializeFMUState)(b, bytes, size, &loaded) == fmi3OK);
    EXPECT(F(fmi3SetFMUState)(b, loaded) == fmi3OK);
    EXPECT(step(a, 1e-3 * (double)steps, 5e-3) == fmi3OK);
    EXPECT(step(b, 1e-3 * (double)steps, 5e-3) == fmi3OK);
    EXPECT(F(fmi3GetFMUState)(a, &kept) == fmi3OK);
    EXPECT(F(fmi3GetFMUState)(b, &loaded) == fmi3OK);
    EXPECT(F(fmi3SerializeFMUState)(a, kept, bytes, size) == fmi3OK);
    EXPECT(F(fmi3SerializeFMUState)(b, loaded, again, size) == fmi3OK);
    EXPECT(!memcmp(bytes, again, size));
    EXPECT(F(fmi3FreeFMUState)(a, &kept) == fmi3OK && !kept);
    F(fmi3FreeInstance)(a);
    F(fmi3FreeInstance)(b);
    free(bytes);
    free(again);
}

int main(int count, char **words)
{
    if (count < 5 || !(library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL))) {
        printf("%s\n", count < 5 ? "see above" : dlerror());
        return 2;
    }
    token = words[2];
    bad_calls();
    snapshots(atol(words[3]));
    for (long i = atol(words[4]); i--;)
        F(fmi3FreeInstance)(ready());
    return 0;
}
