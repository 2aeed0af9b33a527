/* The core of a unit: instances, values, steps and snapshots. Every value is checked before anything changes. */

#include "unit.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __x86_64__
#include <cpuid.h>
#endif

static const uint64_t MARK = 0x7374656572756e69u;
static const double SAMPLE = 1e-3;         /* s */
static const double STEP_TOLERANCE = 1e-9; /* s */
static const double MOST_SAMPLES = 3.6e6;  /* in one communication step: an hour */

int unit_refuse(struct instance *c, const char *format, ...)
{
    char text[512];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    c->log(c, text);
    return 0;
}

/* Whether this processor, and the operating system, offer what the code was made for. */
static int processor_suits(void)
{
#ifdef __x86_64__
    for (unsigned i = 0; i < unit.requirement_count; i++) {
        const struct requirement *r = &unit.requirements[i];
        unsigned a, b, c, d;
        if (!__get_cpuid_count(r->leaf, 0, &a, &b, &c, &d))
            return 0;
        uint32_t reported = r->reg == 'a' ? a : r->reg == 'b' ? b : r->reg == 'c' ? c : d;
        if ((reported & r->bits) != r->bits)
            return 0;
        int vectors = (r->leaf == 1 && r->bits >> 28 & 1);   /* AVX */
        int long_vectors = (r->leaf == 7 && r->bits >> 16 & 1); /* AVX-512 */
        if (vectors || long_vectors) { /* the operating system has to save their registers, too */
            uint32_t low, high, needed = long_vectors ? 0xe6 : 0x06;
            if (!__get_cpuid(1, &a, &b, &c, &d) || !(c >> 27 & 1))
                return 0;
            __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
            if ((low & needed) != needed)
                return 0;
        }
    }
#endif
    return 1;
}

struct instance *unit_make(const char *name, const char *token, void (*log)(struct instance *, const char *),
                           void *environment, void (*logger)(void))
{
    struct instance early = {.log = log, .environment = environment, .logger = logger};
    early.name = (char *)(name && *name ? name : "(without a name)");
    if (!name || !*name) {
        unit_refuse(&early, "the instance has no name");
        return NULL;
    }
    if (!token || strcmp(token, unit.token)) {
        unit_refuse(&early, "the description belongs to another binary: it gives %s, the binary has %s",
                    token ? token : "nothing", unit.token);
        return NULL;
    }
    if (!processor_suits()) {
        unit_refuse(&early,
                    "this unit is made for processors of level %s, which this machine does not offer; export it with "
                    "--cpu x86-64",
                    unit.processor);
        return NULL;
    }
    size_t count = CLOCK_COUNT + unit.number_count + unit.given_count + unit.output_count + unit.state_count;
    size_t more = unit.input_count + unit.output_count + unit.state_count;
    struct instance *c = calloc(1, sizeof *c);
    char *own_name = malloc(strlen(name) + 1);
    double *contents = calloc(count + more, sizeof *contents);
    if (!c || !own_name || !contents) {
        free(c);
        free(own_name);
        free(contents);
        unit_refuse(&early, "no memory for an instance");
        return NULL;
    }
    *c = early;
    c->mark = MARK;
    c->name = strcpy(own_name, name);
    c->count = count;
    c->contents = c->clock = contents;
    c->numbers = c->clock + CLOCK_COUNT;
    c->given = c->numbers + unit.number_count;
    c->outputs = c->given + unit.given_count;
    c->state = c->outputs + unit.output_count;
    c->inputs = c->state + unit.state_count;
    c->before = c->inputs + unit.input_count;
    unit_reset(c);
    return c;
}

void unit_reset(struct instance *c)
{
    memset(c->contents, 0, c->count * sizeof *c->contents);
    c->clock[PHASE] = INSTANTIATED;
    c->clock[STOP_TIME] = INFINITY;
    memcpy(c->numbers, unit.numbers, unit.number_count * sizeof *c->numbers);
    memcpy(c->given, unit.given, unit.given_count * sizeof *c->given);
    memcpy(c->outputs, unit.shown, unit.output_count * sizeof *c->outputs);
    memcpy(c->state, unit.start, unit.state_count * sizeof *c->state);
}

void unit_free(struct instance *c)
{
    while (c->snapshots) {
        struct snapshot *next = c->snapshots->next;
        free(c->snapshots);
        c->snapshots = next;
    }
    c->mark = 0;
    free(c->name);
    free(c->contents);
    free(c);
}

static const char *phase_name(unsigned phase)
{
    return phase == INSTANTIATED   ? "before initialization"
           : phase == INITIALISING ? "in initialization mode"
           : phase == STEPPING     ? "in step mode"
                                   : "after termination";
}

int unit_allowed(struct instance *c, unsigned phases, const char *function)
{
    if (!c || c->mark != MARK)
        return 0; /* there is no logger to tell it */
    unsigned phase = (unsigned)c->clock[PHASE];
    return phase & phases ? 1 : unit_refuse(c, "%s is not allowed %s", function, phase_name(phase));
}

double unit_time(const struct instance *c)
{
    return c->clock[START_TIME] + c->clock[SAMPLES] * SAMPLE;
}

int unit_begin(struct instance *c, double start, int stops, double stop)
{
    if (!isfinite(start) || (stops && !(stop > start && isfinite(stop))))
        return unit_refuse(c, "start time %g s and stop time %g s do not enclose a time to simulate", start,
                           stops ? stop : INFINITY);
    c->clock[START_TIME] = start;
    c->clock[STOP_TIME] = stops ? stop : INFINITY;
    return 1;
}

/* Advance the state; 0 after a message that names the state that is no longer finite. */
static int advance(struct instance *c, int64_t samples)
{
    int32_t finite = 0;
    void *unused = NULL;
    int32_t status = steer_advance(&finite, &unused, c->numbers, unit.tables, c->state, c->given, c->inputs,
                                   c->outputs, samples);
    if (status == 0 && finite)
        return 1;
    for (unsigned i = 0; i < unit.state_count; i++)
        if (!isfinite(c->state[i]))
            return unit_refuse(c, "the state %s is no longer finite in the step from %.9g s", unit.states[i],
                               unit_time(c));
    return unit_refuse(c, "the kernel failed with status %d in the step from %.9g s", (int)status, unit_time(c));
}

int unit_settle(struct instance *c)
{
    if (c->clock[STALE] == 0.0)
        return 1;
    size_t size = unit.given_count * sizeof *c->given;
    double *given = malloc(size);
    if (!given)
        return unit_refuse(c, "no memory to settle the state");
    memcpy(given, c->given, size);
    memcpy(c->given, unit.given, size);
    int64_t samples = 0;
    void *unused = NULL;
    steer_begin(&samples, &unused, c->numbers, unit.tables, c->state); /* which cannot fail */
    int done = advance(c, samples);
    memcpy(c->given, given, size);
    free(given);
    if (!done) {
        memcpy(c->outputs, unit.shown, unit.output_count * sizeof *c->outputs);
        memcpy(c->state, unit.start, unit.state_count * sizeof *c->state);
        return unit_refuse(c, "straight running with these parameters does not settle");
    }
    for (unsigned i = 0; i < unit.place_count; i++)
        c->state[unit.places[i]] = 0.0;
    for (unsigned i = 0; i < unit.row_count; i++)
        c->outputs[unit.rows[i]] = 0.0;
    c->clock[STALE] = 0.0;
    return 1;
}

/* The variable of a reference; NULL after a message. */
static const struct variable *variable(struct instance *c, enum type type, uint32_t reference)
{
    static const char *const names[] = {"real", "boolean"};
    if (reference < unit.variable_count && unit.variables[reference].type == type)
        return &unit.variables[reference];
    unit_refuse(c, "value reference %lu is that of no %s variable", (unsigned long)reference, names[type]);
    return NULL;
}

static double *address(struct instance *c, const struct variable *v)
{
    double *arrays[] = {c->numbers, c->given, c->outputs, c->before};
    return arrays[v->array] + v->place;
}

int unit_arrays(struct instance *c, const uint32_t *references, size_t count, const void *values)
{
    return !count || (references && values) || unit_refuse(c, "no array of value references or values");
}

int unit_place(struct instance *c, const void *result)
{
    return result || unit_refuse(c, "there is no place for what the function returns");
}

/* Write the poses of the wheels at this state to ``before``, as nothing needs it between the steps. */
static void pose(struct instance *c)
{
    int32_t done;
    void *unused = NULL;
    memcpy(c->before, c->outputs, unit.output_count * sizeof *c->before);
    unit.poses(&done, &unused, c->numbers, unit.tables, c->state, c->given, c->inputs, c->before);
}

int unit_get(struct instance *c, enum type type, const uint32_t *references, size_t count, double *values)
{
    unsigned phase = (unsigned)c->clock[PHASE];
    if (!unit_arrays(c, references, count, values))
        return 0;
    for (size_t i = 0; i < count; i++) {
        const struct variable *v = variable(c, type, references[i]);
        if (!v)
            return 0;
        if (v->use == OUTPUT && phase == INSTANTIATED)
            return unit_refuse(c, "variable %s has no value before initialization", v->name);
    }
    if (phase == INITIALISING && !unit_settle(c))
        return 0;
    for (size_t i = 0, posed = 0; i < count; i++) {
        const struct variable *v = &unit.variables[references[i]];
        if (v->array == POSES && !posed++)
            pose(c);
        values[i] = v->array == TIME ? unit_time(c) : *address(c, v);
    }
    return 1;
}

/* Whether a variable may take a value now. */
static int may_set(struct instance *c, const struct variable *v, double value)
{
    unsigned phase = (unsigned)c->clock[PHASE];
    if (v->use == OUTPUT || v->use == INDEPENDENT)
        return unit_refuse(c, "variable %s is %s and cannot be set", v->name,
                           v->use == OUTPUT ? "an output" : "the independent one");
    if (phase == TERMINATED)
        return unit_refuse(c, "variable %s cannot be set after termination", v->name);
    if (v->use == FIXED && phase == STEPPING)
        return unit_refuse(c, "parameter %s is fixed: it can be set only until initialization ends", v->name);
    if (!isfinite(value))
        return unit_refuse(c, "variable %s must be finite, got %g", v->name, value);
    if (value < v->low)
        return unit_refuse(c, "variable %s must be at least %.9g, got %.17g", v->name, v->low, value);
    if (value > v->high)
        return unit_refuse(c, "variable %s must be at most %.9g, got %.17g", v->name, v->high, value);
    return 1;
}

int unit_settable(struct instance *c, enum type type, uint32_t reference, double value)
{
    const struct variable *v = variable(c, type, reference);
    return v && may_set(c, v, value);
}

int unit_set(struct instance *c, enum type type, const uint32_t *references, size_t count, const double *values)
{
    if (!unit_arrays(c, references, count, values))
        return 0;
    for (size_t i = 0; i < count; i++)
        if (!unit_settable(c, type, references[i], values[i]))
            return 0;
    for (size_t i = 0; i < count; i++) {
        const struct variable *v = &unit.variables[references[i]];
        double *now = address(c, v);
        if (v->array == NUMBERS && *now != values[i] && c->clock[PHASE] != STEPPING)
            c->clock[STALE] = 1.0;
        *now = values[i];
    }
    return 1;
}

int unit_step(struct instance *c, double time, double size)
{
    if (!(size > 0.0) || !(size <= MOST_SAMPLES * SAMPLE))
        return unit_refuse(c, "the communication step must be positive and at most %g s, got %g s",
                           MOST_SAMPLES * SAMPLE, size);
    double samples = (double)(int64_t)(size / SAMPLE + 0.5);
    if (samples < 1.0 || !(fabs(size - samples * SAMPLE) <= STEP_TOLERANCE))
        return unit_refuse(c, "the communication step must be a whole number of milliseconds, got %.12g s", size);
    if (!(fabs(time - unit_time(c)) < 0.5 * SAMPLE))
        return unit_refuse(c, "the step begins at %.9g s, but the unit is at %.9g s", time, unit_time(c));
    if (unit_time(c) + size > c->clock[STOP_TIME] + 0.5 * SAMPLE)
        return unit_refuse(c, "the step from %.9g s by %.9g s passes the stop time %.9g s", time, size,
                           c->clock[STOP_TIME]);
    size_t kept = (unit.output_count + unit.state_count) * sizeof *c->before;
    memcpy(c->before, c->outputs, kept); /* the state stands behind the outputs */
    if (!advance(c, (int64_t)samples)) {
        memcpy(c->outputs, c->before, kept);
        return 0;
    }
    c->clock[SAMPLES] += samples;
    return 1;
}

static struct snapshot *known(struct instance *c, struct snapshot *snapshot)
{
    for (struct snapshot *s = c->snapshots; s; s = s->next)
        if (s == snapshot)
            return s;
    unit_refuse(c, "the FMU state is none of this instance, or was freed");
    return NULL;
}

static struct snapshot *new_snapshot(struct instance *c)
{
    struct snapshot *s = malloc(sizeof *s + c->count * sizeof *s->contents);
    if (!s) {
        unit_refuse(c, "no memory for an FMU state");
        return NULL;
    }
    s->next = c->snapshots;
    c->snapshots = s;
    return s;
}

int unit_keep(struct instance *c, struct snapshot **snapshot)
{
    if (!unit_place(c, snapshot))
        return 0;
    struct snapshot *s = *snapshot ? known(c, *snapshot) : new_snapshot(c);
    if (!s)
        return 0;
    memcpy(s->contents, c->contents, c->count * sizeof *s->contents);
    *snapshot = s;
    return 1;
}

int unit_restore(struct instance *c, struct snapshot *snapshot)
{
    struct snapshot *s = known(c, snapshot);
    if (s)
        memcpy(c->contents, s->contents, c->count * sizeof *s->contents);
    return s != NULL;
}

int unit_forget(struct instance *c, struct snapshot **snapshot)
{
    if (!snapshot || !*snapshot)
        return 1; /* as the standard has it */
    if (!known(c, *snapshot))
        return 0;
    struct snapshot **link = &c->snapshots;
    while (*link != *snapshot)
        link = &(*link)->next;
    *link = (*snapshot)->next;
    free(*snapshot);
    *snapshot = NULL;
    return 1;
}

/* A stored state: a word that tells the unit, the numbers, and a word that tells whether both are whole. */
static uint64_t hashed(uint64_t hash, const void *bytes, size_t size)
{
    for (const unsigned char *b = bytes; size--; b++) /* FNV-1a */
        hash = (hash ^ *b) * 0x100000001b3u;
    return hash;
}

static const uint64_t HASH_START = 0xcbf29ce484222325u;

size_t unit_stored_size(struct instance *c)
{
    return c->count * sizeof *c->contents + 2 * sizeof(uint64_t);
}

int unit_store(struct instance *c, struct snapshot *snapshot, unsigned char *bytes, size_t size)
{
    struct snapshot *s = known(c, snapshot);
    if (!s)
        return 0;
    if (!bytes || size < unit_stored_size(c))
        return unit_refuse(c, "the FMU state takes %lu bytes, got room for %lu", (unsigned long)unit_stored_size(c),
                           (unsigned long)size);
    size_t length = c->count * sizeof *s->contents;
    uint64_t words[] = {hashed(HASH_START, unit.token, strlen(unit.token)), 0};
    words[1] = hashed(words[0], s->contents, length);
    memcpy(bytes, &words[0], sizeof words[0]);
    memcpy(bytes + sizeof words[0], s->contents, length);
    memcpy(bytes + sizeof words[0] + length, &words[1], sizeof words[1]);
    return 1;
}

int unit_load(struct instance *c, const unsigned char *bytes, size_t size, struct snapshot **snapshot)
{
    size_t length = c->count * sizeof *c->contents;
    uint64_t words[2];
    if (!bytes || size != unit_stored_size(c) || !snapshot)
        return unit_refuse(c, "the stored FMU state has %lu bytes, this unit's have %lu", (unsigned long)size,
                           (unsigned long)unit_stored_size(c));
    memcpy(&words[0], bytes, sizeof words[0]);
    memcpy(&words[1], bytes + sizeof words[0] + length, sizeof words[1]);
    if (words[0] != hashed(HASH_START, unit.token, strlen(unit.token)))
        return unit_refuse(c, "the stored FMU state is that of another unit");
    if (words[1] != hashed(words[0], bytes + sizeof words[0], length))
        return unit_refuse(c, "the stored FMU state is damaged");
    struct snapshot *s = *snapshot ? known(c, *snapshot) : new_snapshot(c);
    if (!s)
        return 0;
    memcpy(s->contents, bytes + sizeof words[0], length);
    *snapshot = s;
    return 1;
}
