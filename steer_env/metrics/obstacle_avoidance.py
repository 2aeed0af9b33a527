"""Obstacle avoidance, a lane change at any speed, after ISO 3888-2."""

from steer_env.metrics.common.lane_change_metrics import register_lane_change

register_lane_change("obstacle-avoidance")
