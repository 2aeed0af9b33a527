"""An assist in another process, behind a socket of this machine, in the benchmark: its score beside the baselines.

python examples/process_controller.py &                   the other process, until it is ended
steer-env benchmark examples/process_controller.py:ProcessAssist --suite assists

A message is a line of JSON, and so is the answer, so that the other process may be a program in any language; the one
here is to be replaced by it. A process that is silent for ten seconds ends the benchmark with an error.
"""

import json
import socket
import socketserver

import numpy as np

ADDRESS = "127.0.0.1", 50211


class ProcessAssist:
    """What an assist observes."""

    tuning = "in the other process"

    def __init__(self, env):
        own = env.unwrapped
        self.rows = np.arange(env.num_envs)
        self.units = own.observation_scale  # an observation times it is in SI units
        self.largest = own.task.action.scale  # torque of an action of 1 [N m]
        with socket.create_connection(ADDRESS, timeout=10.0) as connection:  # it lives as long as its file
            self.lines = connection.makefile("rw", encoding="utf-8")
        self.tell({"observed": [quantity.name for quantity in own.task.observed], "dt": own.control_dt})

    def reset(self, sub_environments=slice(None)):
        self.tell({"reset": self.rows[sub_environments].tolist()})

    def act(self, observation):
        torque = self.tell({"act": (observation * self.units).tolist()})  # of each row [N m]
        return np.reshape(torque, (-1, 1)) / self.largest

    def tell(self, message):
        """Send a message; its answer."""
        self.lines.write(json.dumps(message) + "\n")
        self.lines.flush()
        answer = self.lines.readline()
        if not answer:
            raise ConnectionError("the other process has closed the connection")
        return json.loads(answer)


class Program(socketserver.StreamRequestHandler):
    """The other process. Each id has a connection of its own: quantities in their order, then resets and decisions."""

    def handle(self):
        for line in self.rfile:
            message, answer = json.loads(line), None
            if "observed" in message:
                bar, speed = map(message["observed"].index, ("torsion_bar_torque", "speed"))
            elif "act" in message:
                answer = [(3.0 if row[speed] < 3.0 else 0.15) * row[bar] for row in message["act"]]
            self.wfile.write(json.dumps(answer).encode() + b"\n")


if __name__ == "__main__":
    with socketserver.ThreadingTCPServer(ADDRESS, Program) as server:
        server.serve_forever()
