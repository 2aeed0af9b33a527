/* The steering: column with friction, assist and end stops, without a chassis, in steps of 1 ms.
 *
 * {{ told }}
 * For a Cortex-M7 whose floating-point unit has double precision, floats passed in its registers:
 * -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard. SI units and radians; left is positive. */

#ifndef STEERING_H
#define STEERING_H

#ifdef __cplusplus
extern "C" {
#endif

{% for name, members in (("inputs", inputs), ("outputs", outputs), ("parameters", parameters)) %}
struct steering_{{ name }} {
{% for member in members %}
    double {{ member.declared }}; /* {{ member.comment }} */
{% endfor %}
};

{% endfor %}
struct steering {
    const struct steering_parameters *parameters; /* may point to a changed copy */
    struct steering_inputs inputs;
    struct steering_outputs outputs;
    double state[{{ states }}];
};

extern const struct steering_parameters steering_parameters; /* those of the export */

/* Begin at rest with the parameters of the export. */
void steering_begin(struct steering *s);

/* Advance by 1 ms under the inputs. 0 where a state is no longer finite: begin again; otherwise 1. */
int steering_step(struct steering *s);

#ifdef __cplusplus
}
#endif

#endif
