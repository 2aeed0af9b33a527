"""Subsystems of a plant: what advances sample by sample with named inputs, outputs, parameters and state.

The whole car, the steering alone and the chassis alone are subsystems. Each is data (:class:`Subsystem`) with a kernel
that :func:`advance` selects. An FMU, a server over UDP, the real-time loop, a drive and the coupling with an external
vehicle use them and know nothing of what is within; neither does anything here know a friction law. A car is advanced
by 20 ms under a constant hand torque of 1 N m by::

    car = subsystems.make("car", cars.load("compact").plant("lugre", speed=20.0), 20.0)
    state, given = car.start.copy(), np.zeros(car.given_size)
    inputs, outputs = np.zeros((1, car.inputs)), np.zeros((1, len(car.outputs)))
    given[0] = 1.0
    subsystems.advance(subsystems.Car(car.parameters), state, given, inputs, outputs, 20)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
