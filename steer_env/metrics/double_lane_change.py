"""Double lane change at a given speed, after ISO 3888-1."""

from steer_env.metrics.common.lane_change_metrics import register_lane_change

register_lane_change("double-lane-change", speed_m_s=80 / 3.6)
