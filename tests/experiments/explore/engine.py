"""The scripts of the page without a page: run by V8, the engine of Chromium, in this process."""

import json
from functools import lru_cache

from py_mini_racer import MiniRacer

from steer_env.experiments.explore import module, parameters, writing
from steer_env.friction.numerics.packing import pack
from steer_env.vehicle import cars

START = """
const { drives } = declared, { constants } = drives;
const simulation = steerSimulation(drives.rate, drives.regrip), metrics = steerMetrics(drives.filters, drives.rate);
const stability = steerStability({ ...constants.linear, ...constants.stability }, drives.functions);
const readers = Object.fromEntries(
  Object.entries(STEER_READERS).map(([name, reader]) => [name, reader(metrics, constants)]));
const policies = steerPolicies();
const modules = [wasm, beginning].map((bytes) => new WebAssembly.Module(Uint8Array.from(bytes)));
const imports = modules.flatMap((one) => WebAssembly.Module.imports(one).map(({ name }) => name));
const shared = Float64Array.from(tables), begun = new simulation.Beginning(structure, modules[1], shared);
const car = new simulation.Car(structure, modules[0], begun, shared);
const exchanging = steerExchange(declared.drive), handing = steerHands(declared.drive);
const logging = steerLog(declared.drive), staircases = steerStaircase(declared.drive.blind);
function whole(steps) {
  let step;
  do step = steps.next();
  while (!step.done);
  return step.value;
}
"""


class Engine:
    """A car with a law on a chassis, as the worker of the page has it."""

    def __init__(self, law, body, vehicle):
        self._context, self.vehicle = MiniRacer(), vehicle
        for name in (
            "metrics*",
            "policy",
            "simulation",
            "stability",
            "worker",
            "exchange",
            "hands",
            "pace",
            "log",
            "staircase",
        ):
            for file in sorted(writing.PAGE_FOLDER.glob(f"{name}.js")):
                self._context.eval(file.read_text(encoding="utf-8"))
        car, which = cars.load(vehicle), writing.Combination(law, body)
        own, begun = (parameters.plant(car, each, body, {}) for each in (law, module.BEGINNING))
        self.structure = writing.structure(car, which)
        given = {"structure": self.structure, "declared": writing.declared(car, [which])}
        given |= {"wasm": list(module.advancing(own)), "beginning": list(module.beginning(begun))}
        for name, value in {**given, "tables": pack(own).tables.tolist()}.items():
            self._context.eval(f"const {name} = JSON.parse({json.dumps(json.dumps(value))});")
        self._context.eval(START)

    def value(self, expression, **given):
        """What an expression gives, with names for values of Python; numbers that are not finite are None."""
        names = ", ".join(given)
        values = ", ".join(f"JSON.parse({json.dumps(json.dumps(value))})" for value in given.values())
        plain = "(key, value) => ArrayBuffer.isView(value) ? Array.from(value) : value"
        found = self._context.eval(f"JSON.stringify((({names}) => {expression})({values}), {plain})")
        return json.loads(found)


@lru_cache(3)
def engine(law, body, vehicle="compact"):
    """The engine of a car with a law on a chassis; the last three are kept, as several tests in a row need them."""
    return Engine(law, body, vehicle)
