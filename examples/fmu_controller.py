"""An assist of another tool, an FMU for co-simulation of FMI 2.0, in the benchmark: its score beside the baselines.

steer-env benchmark examples/fmu_controller.py:FmuAssist --suite assists        needs the extra fmu

A copy of the FMU assists in each sub-environment. At every decision it gets what an assist observes, in SI units,
advances by the time to the next decision and gives its torque. It is a program that runs with your rights, in the
process of the benchmark: load one that you trust.
"""

import fmpy
import numpy as np

FMU = "assist.fmu"
INPUTS = {"torsion_bar_torque": "bar_torque", "column_speed": "column_speed", "speed": "vehicle_speed"}
OUTPUT = "assist_torque"  # added to the boost, positive where it pushes to the left [N m]


class FmuAssist:
    """Torsion-bar torque, column speed, speed."""

    tuning = "in the other tool"

    def __init__(self, env):
        self.description = fmpy.read_model_description(FMU)
        self.folder = fmpy.extract(FMU)
        number = {variable.name: variable.valueReference for variable in self.description.modelVariables}
        self.inputs, self.output = [number[name] for name in INPUTS.values()], [number[OUTPUT]]
        own = env.unwrapped
        names = [quantity.name for quantity in own.task.observed]
        self.seen = [names.index(name) for name in INPUTS]
        self.units = own.observation_scale[self.seen]  # an observation times it is in SI units
        self.largest, self.dt = own.task.action.scale, own.control_dt
        self.copies = [None] * env.num_envs
        self.steps = np.zeros(env.num_envs, int)  # since the start of each episode

    def reset(self, sub_environments=slice(None)):
        for i in np.arange(len(self.copies))[sub_environments]:
            if self.copies[i]:
                self.copies[i].terminate()
                self.copies[i].freeInstance()
            self.copies[i] = fmpy.instantiate_fmu(self.folder, self.description, "CoSimulation")
            self.copies[i].setupExperiment(startTime=0.0)
            self.copies[i].enterInitializationMode()
            self.copies[i].exitInitializationMode()
            self.steps[i] = 0

    def act(self, observation):
        torque = np.empty((len(self.copies), 1))
        for i, (copy, seen) in enumerate(zip(self.copies, observation[:, self.seen] * self.units)):
            copy.setReal(self.inputs, seen.tolist())
            copy.doStep(self.steps[i] * self.dt, self.dt)
            torque[i] = copy.getReal(self.output)
        self.steps += 1
        return torque / self.largest
