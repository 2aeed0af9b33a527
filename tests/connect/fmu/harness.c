/* Drives a unit of FMI 2.0 as a C importer does.
 *
 *   harness LIBRARY TOKEN time STEPS            nanoseconds of a step of 1 ms
 *   harness LIBRARY TOKEN print STEPS INPUT OUTPUT...  a line after each step with a sine at the input; hexadecimal
 *   harness LIBRARY TOKEN check STEPS INSTANCES  every bad call, many instances and steps; the growth of memory [bytes]
 *   harness LIBRARY TOKEN weave STEPS ANGLE RATE START SPEEDS OUTPUT...  the same of a weave, one after another at
 *                                               speeds with commas between them, to which the parameter START is set
 */

#include "fmi2FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define dlopen(name, flags) ((void *)LoadLibraryA(name))
#define dlsym(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#define dlerror() "the library cannot be loaded"
#else
#include <dlfcn.h>
#include <unistd.h>
#endif
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

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
/* A call that has to fail with a message that holds a text. */
#define REFUSED(call, text)                                                                                           \
    do {                                                                                                              \
        last[0] = 0;                                                                                                  \
        EXPECT((call) == fmi2Error);                                                                                  \
        EXPECT(strstr(last, text));                                                                                   \
    } while (0)

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    va_list values;
    va_start(values, message);
    vsnprintf(last, sizeof last, message, values);
    va_end(values);
}

static fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

static fmi2Component ready(void)
{
    fmi2Component c = F(fmi2Instantiate)("unit", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    EXPECT(c);
    EXPECT(F(fmi2SetupExperiment)(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
    EXPECT(F(fmi2EnterInitializationMode)(c) == fmi2OK);
    EXPECT(F(fmi2ExitInitializationMode)(c) == fmi2OK);
    return c;
}

static long resident(void)
{
    long pages = 0;
#ifndef _WIN32
    long total;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file && fscanf(file, "%ld %ld", &total, &pages) != 2)
        pages = 0;
    if (file)
        fclose(file);
    pages *= sysconf(_SC_PAGESIZE);
#endif
    return pages;
}

static void run(fmi2Component c, long steps)
{
    fmi2DoStepTYPE *step = F(fmi2DoStep);
    for (long i = 0; i < steps; i++)
        EXPECT(step(c, 1e-3 * i, 1e-3, fmi2True) == fmi2OK);
}

static void bad_values(fmi2Component c)
{
    fmi2ValueReference torque = 0, angle = 1, unknown = 100000;
    fmi2Real value = NAN, before, after, pair[] = {1.0, INFINITY};
    fmi2ValueReference both[] = {torque, angle};
    REFUSED(F(fmi2SetReal)(c, &torque, 1, &value), "hand_torque must be finite");
    EXPECT(F(fmi2GetReal)(c, &torque, 1, &before) == fmi2OK);
    REFUSED(F(fmi2SetReal)(c, both, 2, pair), "hand_angle must be finite");
    EXPECT(F(fmi2GetReal)(c, &torque, 1, &after) == fmi2OK && before == after); /* nothing of a bad call is taken */
    REFUSED(F(fmi2SetReal)(c, &unknown, 1, pair), "value reference 100000");
    REFUSED(F(fmi2GetReal)(c, &unknown, 1, &value), "value reference 100000");
    REFUSED(F(fmi2GetInteger)(c, &torque, 1, (fmi2Integer[]){0}), "no integer variables");
    REFUSED(F(fmi2GetBoolean)(c, &torque, 1, (fmi2Boolean[]){0}), "no boolean variable");
    REFUSED(F(fmi2SetReal)(c, NULL, 1, pair), "no array");
    REFUSED(F(fmi2SetBoolean)(c, &torque, 1, NULL), "no array");
    REFUSED(F(fmi2GetBoolean)(c, &torque, 1, NULL), "no array");
    REFUSED(F(fmi2CancelStep)(c), "fmi2CancelStep");
    value = 201.0;
    REFUSED(F(fmi2SetReal)(c, &torque, 1, &value), "hand_torque must be at most 200, got 201");
    REFUSED(F(fmi2GetReal)(c, NULL, 1, &value), "no array");
    REFUSED(F(fmi2GetReal)(c, &torque, 1, NULL), "no array");
    REFUSED(F(fmi2GetRealStatus)(c, fmi2LastSuccessfulTime, NULL), "no place");
    REFUSED(F(fmi2GetBooleanStatus)(c, fmi2Terminated, NULL), "no place");
    REFUSED(F(fmi2GetFMUstate)(c, NULL), "no place");
    REFUSED(F(fmi2SerializedFMUstateSize)(c, NULL, NULL), "no place");
}

static void bad_steps(fmi2Component c)
{
    const double sizes[] = {0.0, -1e-3, 1e9, INFINITY, NAN};
    for (unsigned i = 0; i < sizeof sizes / sizeof *sizes; i++)
        REFUSED(F(fmi2DoStep)(c, 0.0, sizes[i], fmi2True), "must be positive and at most");
    REFUSED(F(fmi2DoStep)(c, 0.0, 1.5e-3, fmi2True), "whole number of milliseconds");
    REFUSED(F(fmi2DoStep)(c, 0.0, 1e-5, fmi2True), "whole number of milliseconds");
    REFUSED(F(fmi2DoStep)(c, 0.0, 1e-3 + 2e-9, fmi2True), "whole number of milliseconds");
    REFUSED(F(fmi2DoStep)(c, 1.0, 1e-3, fmi2True), "but the unit is at 0 s");
    REFUSED(F(fmi2DoStep)(c, NAN, 1e-3, fmi2True), "but the unit is at 0 s");
    EXPECT(F(fmi2DoStep)(c, 0.0, 1e-3 + 0.9e-9, fmi2True) == fmi2OK);
    EXPECT(F(fmi2DoStep)(c, 1e-3, 5e-3, fmi2True) == fmi2OK);
}

static void bad_order(void)
{
    EXPECT(F(fmi2DoStep)(NULL, 0.0, 1e-3, fmi2True) == fmi2Error);
    EXPECT(!F(fmi2Instantiate)("unit", fmi2CoSimulation, "{0}", "", &callbacks, fmi2False, fmi2False));
    EXPECT(strstr(last, "another binary"));
    EXPECT(!F(fmi2Instantiate)("unit", fmi2ModelExchange, token, "", &callbacks, fmi2False, fmi2False));
    EXPECT(!F(fmi2Instantiate)("", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False));
    EXPECT(!F(fmi2Instantiate)("unit", fmi2CoSimulation, token, "", NULL, fmi2False, fmi2False));
    fmi2Component c = F(fmi2Instantiate)("unit", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    REFUSED(F(fmi2DoStep)(c, 0.0, 1e-3, fmi2True), "fmi2DoStep is not allowed before initialization");
    REFUSED(F(fmi2ExitInitializationMode)(c), "not allowed before");
    REFUSED(F(fmi2SetupExperiment)(c, fmi2False, 0.0, NAN, fmi2False, 0.0), "start time");
    REFUSED(F(fmi2SetupExperiment)(c, fmi2False, 0.0, 1.0, fmi2True, 1.0), "stop time");
    EXPECT(F(fmi2SetupExperiment)(c, fmi2False, 0.0, 2.0, fmi2True, 2.01) == fmi2OK);
    EXPECT(F(fmi2EnterInitializationMode)(c) == fmi2OK);
    REFUSED(F(fmi2DoStep)(c, 0.0, 1e-3, fmi2True), "in initialization mode");
    EXPECT(F(fmi2ExitInitializationMode)(c) == fmi2OK);
    EXPECT(F(fmi2DoStep)(c, 2.0, 0.01, fmi2True) == fmi2OK);
    REFUSED(F(fmi2DoStep)(c, 2.01, 1e-3, fmi2True), "passes the stop time");
    EXPECT(F(fmi2Terminate)(c) == fmi2OK);
    REFUSED(F(fmi2DoStep)(c, 2.01, 1e-3, fmi2True), "after termination");
    EXPECT(F(fmi2Reset)(c) == fmi2OK);
    EXPECT(F(fmi2SetupExperiment)(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
    F(fmi2FreeInstance)(c);
    F(fmi2FreeInstance)(NULL);
}

/* The state of a run comes back by a snapshot and by bytes; foreign, cut and changed ones are refused. */
static void snapshots(void)
{
    fmi2Component a = ready(), b = ready();
    fmi2ValueReference torque = 0;
    fmi2Real push = 2.0;
    fmi2FMUstate kept = NULL, loaded = NULL;
    size_t size = 0;
    EXPECT(F(fmi2SetReal)(a, &torque, 1, &push) == fmi2OK);
    run(a, 20);
    EXPECT(F(fmi2GetFMUstate)(a, &kept) == fmi2OK);
    EXPECT(F(fmi2SerializedFMUstateSize)(a, kept, &size) == fmi2OK);
    fmi2Byte *bytes = malloc(size), *again = malloc(size);
    EXPECT(F(fmi2SerializeFMUstate)(a, kept, bytes, size) == fmi2OK);
    REFUSED(F(fmi2SerializeFMUstate)(a, kept, bytes, size - 1), "takes");
    REFUSED(F(fmi2SetFMUstate)(b, kept), "none of this instance");
    REFUSED(F(fmi2SetFMUstate)(a, NULL), "none of this instance");
    REFUSED(F(fmi2DeSerializeFMUstate)(b, bytes, size - 8, &loaded), "bytes");
    bytes[size / 2] ^= 1;
    REFUSED(F(fmi2DeSerializeFMUstate)(b, bytes, size, &loaded), "damaged");
    bytes[size / 2] ^= 1;
    bytes[0] ^= 1;
    REFUSED(F(fmi2DeSerializeFMUstate)(b, bytes, size, &loaded), "another unit");
    bytes[0] ^= 1;
    EXPECT(!loaded);
    EXPECT(F(fmi2DeSerializeFMUstate)(b, bytes, size, &loaded) == fmi2OK);
    EXPECT(F(fmi2SetFMUstate)(b, loaded) == fmi2OK);
    for (int i = 0; i < 10; i++) { /* both go on alike from 20 ms */
        EXPECT(F(fmi2DoStep)(a, 0.02 + 1e-3 * i, 1e-3, fmi2True) == fmi2OK);
        EXPECT(F(fmi2DoStep)(b, 0.02 + 1e-3 * i, 1e-3, fmi2True) == fmi2OK);
    }
    EXPECT(F(fmi2GetFMUstate)(a, &kept) == fmi2OK);
    EXPECT(F(fmi2GetFMUstate)(b, &loaded) == fmi2OK);
    EXPECT(F(fmi2SerializeFMUstate)(a, kept, bytes, size) == fmi2OK);
    EXPECT(F(fmi2SerializeFMUstate)(b, loaded, again, size) == fmi2OK);
    EXPECT(!memcmp(bytes, again, size));
    EXPECT(F(fmi2FreeFMUstate)(a, &kept) == fmi2OK && !kept);
    F(fmi2FreeInstance)(a);
    F(fmi2FreeInstance)(b); /* with a snapshot that nobody freed */
    free(bytes);
    free(again);
}

static void check(long steps, long instances)
{
    bad_order();
    fmi2Component c = ready();
    bad_values(c);
    bad_steps(c);
    F(fmi2FreeInstance)(c);
    snapshots();
    fmi2Component long_run = ready();
    run(long_run, 10);
    EXPECT(F(fmi2Reset)(long_run) == fmi2OK);
    F(fmi2FreeInstance)(long_run);
    long_run = ready();
    long before = resident();
    run(long_run, steps);
    F(fmi2FreeInstance)(long_run);
    for (long i = 0; i < instances; i++)
        F(fmi2FreeInstance)(ready());
    printf("%ld\n", resident() - before);
}

/* Outputs by their references, on a line. */
static void print_line(fmi2Component c, char **outputs, int count)
{
    for (int k = 0; k < count; k++) {
        fmi2ValueReference output = (fmi2ValueReference)atol(outputs[k]);
        fmi2Real value;
        EXPECT(F(fmi2GetReal)(c, &output, 1, &value) == fmi2OK);
        printf("%a ", value);
    }
    printf("\n");
}

static void print(fmi2Component c, long steps, fmi2ValueReference input, char **outputs, int count)
{
    for (long i = 0; i < steps; i++) {
        fmi2Real value = 4.0 * sin(3e-3 * (double)(i + 1));
        EXPECT(F(fmi2SetReal)(c, &input, 1, &value) == fmi2OK);
        EXPECT(F(fmi2DoStep)(c, 1e-3 * (double)i, 1e-3, fmi2True) == fmi2OK);
        print_line(c, outputs, count);
    }
}

/* A weave of 0.2 Hz by one instance, which begins anew at every speed. */
static void weave(long steps, char **words, char **outputs, int count)
{
    const double amplitude = 0.3, omega = 2.0 * 3.14159265358979 * 0.2;
    fmi2ValueReference hands[] = {(fmi2ValueReference)atol(words[0]), (fmi2ValueReference)atol(words[1])};
    fmi2ValueReference start = (fmi2ValueReference)atol(words[2]);
    fmi2Component c = F(fmi2Instantiate)("unit", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    EXPECT(c);
    for (char *word = strtok(words[3], ","); word; word = strtok(NULL, ",")) {
        fmi2Real speed = strtod(word, NULL);
        EXPECT(F(fmi2SetupExperiment)(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
        EXPECT(F(fmi2SetReal)(c, &start, 1, &speed) == fmi2OK);
        EXPECT(F(fmi2EnterInitializationMode)(c) == fmi2OK);
        print_line(c, outputs, count);
        EXPECT(F(fmi2ExitInitializationMode)(c) == fmi2OK);
        for (long i = 0; i < steps; i++) {
            double t = 1e-3 * (double)(i + 1);
            fmi2Real hand[] = {amplitude * sin(omega * t), amplitude * omega * cos(omega * t)};
            EXPECT(F(fmi2SetReal)(c, hands, 2, hand) == fmi2OK);
            EXPECT(F(fmi2DoStep)(c, 1e-3 * (double)i, 1e-3, fmi2True) == fmi2OK);
            print_line(c, outputs, count);
        }
        REFUSED(F(fmi2SetReal)(c, &start, 1, &speed), "can be set only until initialization ends");
        EXPECT(F(fmi2Reset)(c) == fmi2OK);
    }
    F(fmi2FreeInstance)(c);
}

int main(int count, char **words)
{
    if (count < 5 || !(library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL))) {
        printf("%s\n", count < 5 ? "see above" : dlerror());
        return 2;
    }
    token = words[2];
    long steps = atol(words[4]);
    if (!strcmp(words[3], "check") && count > 5) {
        check(steps, atol(words[5]));
        return 0;
    }
    if (!strcmp(words[3], "weave") && count > 9) {
        weave(steps, words + 5, words + 9, count - 9);
        return 0;
    }
    fmi2Component c = ready();
    if (!strcmp(words[3], "print") && count > 5) {
        print(c, steps, (fmi2ValueReference)atol(words[5]), words + 6, count - 6);
        F(fmi2FreeInstance)(c);
        return 0;
    }
    struct timespec start, end;
    timespec_get(&start, TIME_UTC);
    run(c, steps);
    timespec_get(&end, TIME_UTC);
    F(fmi2FreeInstance)(c);
    printf("%.1f\n", ((end.tv_sec - start.tv_sec) * 1e9 + (end.tv_nsec - start.tv_nsec)) / steps);
    return 0;
}
