"""The points of a path that a driver, or a policy in his place, sees ahead of the car."""

PREVIEW_TIMES = tuple(0.1 * k for k in range(1, 16))  # [s]; published preview drivers look 1.0 to 1.5 s ahead
PREVIEW_NAMES = tuple(f"path_{t:.1f}s" for t in PREVIEW_TIMES)  # observations: lateral positions of these points
LATERAL_OFFSET, HEADING_ERROR, AHEAD = range(3)  # places in what is seen of a path; the points follow from the last one
