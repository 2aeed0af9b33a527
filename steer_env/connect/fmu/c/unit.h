/* What a unit is made of: its numbers (generated), its step (object code of the kernels) and the core, which the
 * functions of FMI 2.0 and 3.0 share. */

#ifndef STEER_UNIT_H
#define STEER_UNIT_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* Several FMUs in a process must not find one another's, whatever the options of the compiler. */
#pragma GCC visibility push(hidden)

enum array { NUMBERS, GIVEN, OUTPUTS, POSES, TIME };
enum use { INPUT, OUTPUT, FIXED, TUNABLE, INDEPENDENT };
enum type { REAL, BOOLEAN };

struct variable {
    const char *name;
    enum array array; /* where its value stands (TIME: in the clock; POSES: computed as they are read), */
    unsigned place;   /* and at which position there */
    enum use use;
    enum type type;
    double low, high; /* values beyond are refused */
};

/* Bits that the instruction cpuid has to report. */
struct requirement {
    uint32_t leaf;
    char reg; /* 'a' to 'd' */
    uint32_t bits;
};

/* The kernels; see object_code.py. */
typedef int32_t kernel(int32_t *done, void **unused, const double *numbers, const double *tables, double *state,
                       const double *given, double *inputs, double *outputs);
int32_t steer_advance(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
                      const double *given, double *inputs, double *outputs, int64_t samples);
int32_t steer_begin(int64_t *samples, void **unused, const double *numbers, const double *tables, double *state);
kernel steer_poses;

struct unit {
    const char *token;     /* identifies description and binary as belonging together */
    const char *processor; /* name of the level that the code was made for */
    const struct requirement *requirements;
    const struct variable *variables;
    const char *const *states; /* names */
    const double *numbers;     /* parameters, of which each instance has a copy */
    const double *tables;      /* parameters that all instances share */
    const double *start;       /* settled state with the parameters above */
    const double *shown;       /* its outputs */
    const double *given;       /* inputs at the start */
    const unsigned *places;    /* states that begin at zero after settling */
    const unsigned *rows;      /* outputs that begin at zero after settling */
    kernel *poses;             /* writes the poses of the wheels behind the other outputs; NULL where there are none */
    unsigned requirement_count, variable_count, number_count, state_count, given_count, input_count, output_count,
        place_count, row_count;
};

extern const struct unit unit;

/* Phases of an instance, as bits. */
enum phase { INSTANTIATED = 1, INITIALISING = 2, STEPPING = 4, TERMINATED = 8 };
enum { ANY_PHASE = INSTANTIATED | INITIALISING | STEPPING | TERMINATED };

struct snapshot {
    struct snapshot *next;
    double contents[];
};

struct instance {
    uint64_t mark; /* tells an instance from other memory */
    void (*log)(struct instance *, const char *text);
    void *environment;
    void (*logger)(void); /* the importer's function, of the type that its version of FMI gives it */
    char *name;
    struct snapshot *snapshots;
    size_t count;      /* numbers that a snapshot holds */
    double *contents;  /* all that changes: the clock, parameters, inputs, outputs and state */
    double *clock;     /* these point into it */
    double *numbers;
    double *given;
    double *outputs;
    double *state;
    double *inputs;    /* what the kernels receive in a sample */
    double *before;    /* outputs and state at the last communication point */
};

/* The clock. STALE is 1 where parameters have changed since the state settled. */
enum { PHASE, START_TIME, STOP_TIME, SAMPLES, STALE, CLOCK_COUNT };

struct instance *unit_make(const char *name, const char *token, void (*log)(struct instance *, const char *),
                           void *environment, void (*logger)(void));
void unit_free(struct instance *c);

/* These return 1 if all is well, and 0 after a message; an instance is then as it was before. */
int unit_allowed(struct instance *c, unsigned phases, const char *function);
int unit_begin(struct instance *c, double start, int stops, double stop);
int unit_settle(struct instance *c);
int unit_arrays(struct instance *c, const uint32_t *references, size_t count, const void *values);
int unit_place(struct instance *c, const void *result);
int unit_settable(struct instance *c, enum type type, uint32_t reference, double value);
int unit_get(struct instance *c, enum type type, const uint32_t *references, size_t count, double *values);
int unit_set(struct instance *c, enum type type, const uint32_t *references, size_t count, const double *values);
int unit_step(struct instance *c, double time, double size);
int unit_keep(struct instance *c, struct snapshot **snapshot);
int unit_restore(struct instance *c, struct snapshot *snapshot);
int unit_forget(struct instance *c, struct snapshot **snapshot);
size_t unit_stored_size(struct instance *c);
int unit_store(struct instance *c, struct snapshot *snapshot, unsigned char *bytes, size_t size);
int unit_load(struct instance *c, const unsigned char *bytes, size_t size, struct snapshot **snapshot);
void unit_reset(struct instance *c);
double unit_time(const struct instance *c);
int unit_refuse(struct instance *c, const char *format, ...);

#pragma GCC visibility pop

#endif
