"""The interval at which an environment updates everything that is slower than the plant."""

from steer_env.vehicle.steering.eps import SAMPLE_TIME

SAMPLES_PER_UPDATE = 10  # plant samples of 1 ms
# Scripted inputs, driver models, rewards and disturbances are given or updated at this interval [s].
UPDATE_INTERVAL = SAMPLES_PER_UPDATE * SAMPLE_TIME
