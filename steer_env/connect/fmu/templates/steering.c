/* The numbers of the steering, and the calls of its kernel in steering_kernels.o. {{ told }} */

#include "steering.h"

#include <stddef.h>
#include <stdint.h>

/* The tables belong to the suspension: the steering does not read them. The first two arguments are results. */
int32_t steer_advance(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
                      const double *given, double *inputs, double *outputs, int64_t samples);
int32_t steer_begin(int64_t *samples, void **unused, const double *numbers, const double *tables, double *state);

const struct steering_parameters steering_parameters = {
{% for member in parameters %}
    {{ member.start }},
{% endfor %}
};

void steering_begin(struct steering *s)
{
    int64_t samples;
    void *unused = NULL;
    s->parameters = &steering_parameters;
{% for name, members in (("inputs", inputs), ("outputs", outputs)) %}
    s->{{ name }} = (struct steering_{{ name }}){
{% for member in members %}
        {{ member.start }},
{% endfor %}
    };
{% endfor %}
    steer_begin(&samples, &unused, (const double *)s->parameters, NULL, s->state); /* of rest, which has none */
}

int steering_step(struct steering *s)
{
    int32_t finite = 0;
    void *unused = NULL;
    double sample[1];
    steer_advance(&finite, &unused, (const double *)s->parameters, NULL, s->state, (const double *)&s->inputs, sample,
                  (double *)&s->outputs, 1);
    return finite;
}
