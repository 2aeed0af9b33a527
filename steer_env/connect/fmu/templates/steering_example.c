/* The handwheel turns to and fro once in a second, against a rack force. Prints inputs and outputs of every millisecond.
 *
 * arm-none-eabi-gcc -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard -O2 steering_example.c steering.c \
 *     steering_kernels.o -lm, with the startup code and the linker script of the board. */

#include "steering.h"

#include <math.h>
#include <stdio.h>

static struct steering steering;

static void print(const double *values, size_t size)
{
    for (size_t i = 0; i < size / sizeof *values; i++)
        printf("%.17g ", values[i]);
}

int main(void)
{
    static struct steering_parameters changed;
    steering_begin(&steering);
    changed = steering_parameters;
    changed.robot = 1.0; /* the handwheel angle is given, not the torque */
    steering.parameters = &changed;
    for (int k = 1; k <= 1000; k++) {
        double phase = 2e-3 * 3.14159265358979 * k;
        steering.inputs.hand_angle = 0.5 * sin(phase);
        steering.inputs.hand_speed = 0.5 * 2.0 * 3.14159265358979 * cos(phase);
        steering.inputs.rack_force = 600.0 * sin(phase - 0.2);
        if (!steering_step(&steering)) {
            puts("a state is no longer finite");
            return 1;
        }
        print((const double *)&steering.inputs, sizeof steering.inputs);
        print((const double *)&steering.outputs, sizeof steering.outputs);
        puts("");
    }
    return 0;
}
