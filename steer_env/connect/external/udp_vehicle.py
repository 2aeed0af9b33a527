"""An external vehicle behind a port: a chassis that ``steer-env serve`` serves, or a program of the same protocol."""

import numpy as np

from steer_env.connect.external.vehicle import OF_PLANT, RACK, VEHICLE_OUTPUT_UNITS, Array, CouplingError
from steer_env.connect.udp import Client, Layout

_EXPORTED_NAMES = {name: name for name in RACK} | {exported: name for name, exported in OF_PLANT.items()}


class UdpVehicle:
    """A chassis over UDP in lockstep; a :class:`steer_env.connect.external.vehicle.Vehicle`.

    Parameters
    ----------
    layout : Layout
        Of the chassis that is served, of which the inputs and outputs have this project's names and units.
    address : tuple of str and int
        Where the server receives.
    speed : float, optional
        Of a chassis that does not report one [m/s].

    Raises
    ------
    CouplingError
        The server refuses, does not answer, or gives what is not finite; of the constructor, where neither tells the
        speed.
    """

    def __init__(self, layout: Layout, address: tuple[str, int], speed: float | None = None) -> None:
        self.name, self.meta = f"{address[0]}:{address[1]}", {"external_vehicle": f"{address[0]}:{address[1]}"}
        names = [signal.name for signal in layout.outputs]
        if speed is None and "longitudinal_speed" not in names:
            raise CouplingError(f"the vehicle at {self.name} does not report its speed: give it")
        self._layout, self._address, self._constant = layout, address, speed
        self.takes = tuple(_EXPORTED_NAMES[signal.name] for signal in layout.inputs)
        self._places = [i for i, name in enumerate(names) if name in VEHICLE_OUTPUT_UNITS]
        self.gives = (*(names[i] for i in self._places), "vehicle_speed")
        self._speed = names.index("longitudinal_speed") if speed is None else -1
        self._read = [*self._places, self._speed] if speed is None else self._places
        self._client: Client | None = None

    def start(self, speed: float) -> Array:
        """Open a new session, which begins in straight running; what the vehicle gives (G,)."""
        self.close()
        try:
            self._client = Client(self._layout, self._address)
        except (ValueError, OSError) as error:
            raise CouplingError(str(error)) from None
        return self._given(self._client.outputs)

    def step(self, taken: Array, samples: int) -> Array:
        """Advance by a communication step; what the vehicle gives at its end (G,)."""
        if self._client is None:
            raise CouplingError(f"the vehicle at {self.name} was not started")
        try:
            outputs = self._client.step(taken, samples)
        except (ValueError, OSError) as error:
            raise CouplingError(f"{error},{self._at()}") from None
        return self._given(outputs)

    def close(self) -> None:
        """Close the session."""
        if self._client is not None:
            client, self._client = self._client, None
            client.__exit__(None, None, None)

    def _at(self) -> str:
        return f" at {self._client.time:.6g} s" if self._client else ""

    def _given(self, outputs: Array) -> Array:
        for i in self._read:
            if not np.isfinite(outputs[i]):
                raise CouplingError(f"{self.name} gave {self._layout.outputs[i].name} = {outputs[i]:.6g}{self._at()}")
        speed = float(outputs[self._speed]) if self._constant is None else self._constant
        return np.append(outputs[self._places], speed)
