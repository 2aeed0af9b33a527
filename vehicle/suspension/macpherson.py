"""MacPherson strut: exact kinematics of the rigid knuckle, the pose of the wheel, and the rack force of its loads.

Every constraint acts on the knuckle by one force: a link along its line, the top mount across the strut axis. A row of
the Jacobian is that unit force and its moment about the lower ball joint. The matrix that solves the kinematics is
therefore also, transposed, that of the static equilibrium of the knuckle.

Axes: x forward, y left, z up, origin on the mid-plane at design wheel-centre height [m]. Angles in
radians. Arrays broadcast over a leading shape ``...``; a plain number is the empty shape.
"""

import json
from collections.abc import Mapping
from functools import cached_property, lru_cache
from itertools import combinations
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]

MIRROR = np.array([1.0, -1.0, 1.0])  # of a point or force across the mid-plane; of a rotation: -MIRROR


class Motion(NamedTuple):
    """Derivative of a pose with respect to a coordinate u, in car axes."""

    wheel_centre: Array  # (..., 3) [m/u]
    contact: Array  # (..., 3), of the contact point taken as fixed to the knuckle [m/u]
    rotation: Array  # (..., 3) angular velocity of the knuckle [rad/u]
    strut_length: Array  # (...) [m/u]


class Pose(NamedTuple):
    """One front wheel at a rack position and a travel: shapes (...), vectors (..., 3)."""

    toe: Array  # toe-in positive [rad]
    steer_angle: Array  # of the wheel's heading about z, left positive [rad]
    camber: Array  # top leaning inward negative [rad]
    inclination: Array  # ISO 8855, about the heading axis, top leaning right positive [rad]
    caster: Array  # king-pin axis leaning back positive [rad]
    kingpin_inclination: Array  # king-pin axis leaning inward positive [rad]
    trail: Array  # king-pin axis ahead of the contact, along the heading on the ground [m]
    scrub: Array  # contact outboard of the king-pin axis, across the heading on the ground [m]
    wheel_centre: Array  # [m]
    contact: Array  # wheel centre less the loaded radius, down along the wheel plane [m]
    rotation: Array  # (..., 3, 3) of the knuckle from its design pose
    strut_length: Array  # from the axis' lower point to the top mount [m]
    lower_ball_joint: Array  # [m]
    strut_top: Array  # [m]
    tie_rod_outer: Array  # [m]
    tie_rod_inner: Array  # [m]
    per_rack: Motion  # u = rack [m], at fixed travel
    per_travel: Motion  # u = travel [m], at fixed rack

    @property
    def roll_centre_height(self) -> Array:
        """Height above the contact where the normal to the contact's path meets the mid-plane [m]."""
        path = self.per_travel.contact
        return self.contact[..., 1] * path[..., 1] / path[..., 2]

    def at_fixed_strut(self) -> Motion:
        """Derivative with respect to the rack at fixed strut length, a turn about the king-pin axis (S6)."""
        slope = self.per_rack.strut_length / self.per_travel.strut_length
        # (S6)
        centre, contact, turn = (u - slope[..., None] * v for u, v in zip(self.per_rack[:3], self.per_travel[:3]))
        return Motion(centre, contact, turn, np.zeros_like(slope))


class WheelLoad(NamedTuple):
    """Loads of road and drive shaft on one knuckle, in the heading axes of the wheel.

    x is along the heading in the road plane, y left, z up; floats or arrays (...). A longitudinal force acts at the
    contact if a brake on the knuckle holds the wheel against it, and at the wheel centre if the drive shaft holds it or
    nothing does (rolling resistance). ``M_y`` reaches the knuckle through the brake only; for a rolling wheel it is
    zero here. The weight of the unsprung mass and the forces of anti-roll bar and bump stop, which act along the
    travel, are a negative ``F_z_centre``.
    """

    F_x_contact: ArrayLike = 0.0  # [N]
    F_x_centre: ArrayLike = 0.0  # [N]
    F_y: ArrayLike = 0.0  # at the contact [N]
    F_z: ArrayLike = 0.0  # at the contact [N]
    M_x: ArrayLike = 0.0  # [N m]
    M_y: ArrayLike = 0.0  # [N m]
    M_z: ArrayLike = 0.0  # [N m]
    F_z_centre: ArrayLike = 0.0  # at the wheel centre: what else pushes the wheel up or, negative, down [N]


def load_coefficients(pose: Pose) -> WheelLoad:
    """Work (...) of each unit load per metre of rack, at fixed strut length: forces [1], moments [rad/m]."""
    motion = pose.at_fixed_strut()
    # Turned back by the steer angle, x + iy of car axes becomes ahead + i left of the heading.
    back = np.exp(-1j * pose.steer_angle)
    centre, contact, turn = (back * (v[..., 0] + 1j * v[..., 1]) for v in motion[:3])
    forces = (contact.real, centre.real, contact.imag, motion.contact[..., 2])
    return WheelLoad(*forces, turn.real, turn.imag, motion.rotation[..., 2], motion.wheel_centre[..., 2])


def rack_force(pose: Pose, load: WheelLoad) -> Array:
    """Rack force of one front wheel, by virtual work on its knuckle (S7).

    F_rack = -sum(F . dp/drack + M . dphi/drack) at fixed strut length. At fixed *travel* the strut changes its length
    as the wheel steers, and its spring, which carries the wheel load along the inclined axis, does work too. Omitting
    that work loses the self-centring effect of the wheel load (strut S1, 3.7 kN for each wheel, 30 mm of rack: -43.5 N
    instead of +269.9 N). The balance in the travel direction eliminates the spring and gives the sum above:
    d/drack = d/drack|travel - d/dtravel (dl/drack)/(dl/dtravel). The sum is over all loads that this balance contains:
    the weight of the unsprung mass and the force of the anti-roll bar rest on the wheel, not on the strut.

    Parameters
    ----------
    pose, load : Pose, WheelLoad
        Of the left or the right wheel, floats or arrays (...).

    Returns
    -------
    F_rack : (...) array
        Positive where it resists a left turn [N]. The rack carries the sum of both wheels.

    Source: virtual work, derived here; equal to the static equilibrium of the knuckle.
    """
    work = [c * np.asarray(f) for c, f in zip(load_coefficients(pose), load)]
    return -np.sum(np.broadcast_arrays(*work), axis=0)  # (S7)


def mirrored(pose: Pose) -> Pose:
    """The mirror image of a pose on the mid-plane: the right wheel at the opposite rack position."""

    def motion(m: Motion, sign: float) -> Motion:
        centre, contact, turn = sign * MIRROR * m.wheel_centre, sign * MIRROR * m.contact, -sign * MIRROR * m.rotation
        return Motion(centre, contact, turn, sign * m.strut_length)

    points = ("wheel_centre", "contact", "lower_ball_joint", "strut_top", "tie_rod_outer", "tie_rod_inner")
    return pose._replace(
        steer_angle=-pose.steer_angle,
        inclination=-pose.inclination,
        rotation=MIRROR[:, None] * pose.rotation * MIRROR,
        per_rack=motion(pose.per_rack, -1.0),
        per_travel=motion(pose.per_travel, 1.0),
        **{name: MIRROR * getattr(pose, name) for name in points},
    )


__all__ = [
    "MIRROR",
    "POINTS",
    "MacPherson",
    "Motion",
    "Pose",
    "WheelLoad",
    "available",
    "load_coefficients",
    "mirrored",
    "rack_force",
]

POINTS = (
    *("wheel_centre", "lower_arm_front_pivot", "lower_arm_rear_pivot", "lower_ball_joint"),
    *("strut_top", "strut_axis_lower_point", "tie_rod_outer", "tie_rod_inner"),
)
SHORTEST = 1e-3  # distance below which two points or lines count as meeting [m] (assumed)
LOOSE_CONDITION = 1e6  # condition number of the constraints from which the knuckle counts as loose (assumed)
STRIDES = (0.010, 0.001)  # of the path to a pose; the short one where the long one does not converge [m]
LARGEST_STEP = 0.3  # largest Newton step on a path; a larger one indicates the end of the range [m, rad]
FARTHEST = 1.0  # largest rack or travel that is tried [m] (assumed)
STRUT = [3, 4, 6]  # rows of the strut: across, across, along
STRUT_FOLDER = Path(__file__).parents[1] / "data" / "struts"


def available() -> tuple[str, ...]:
    """Names of the packaged struts."""
    return tuple(sorted(file.stem for file in STRUT_FOLDER.glob("*.json")))


class MacPherson:
    """A left MacPherson strut by its hard points; immutable.

    Parameters
    ----------
    points : mapping of the names in ``POINTS`` to three coordinates each [m]
        Left wheel in the design position, upright and straight ahead.
    loaded_radius : float
        Height of the wheel centre above the road [m].

    Raises
    ------
    ValueError
        A point is missing, unknown or not finite, coincides with another one, or leaves the knuckle loose; the message
        names the point, its value and what is allowed.

    Rigid links and bushings, rack along y. Source: rigid-body constraints, derived here.
    """

    def __init__(self, points: Mapping[str, ArrayLike], loaded_radius: float) -> None:
        self.points = _checked(points)
        self.loaded_radius = float(loaded_radius)
        if not 0.0 < self.loaded_radius < 2.0:
            raise ValueError(f"loaded_radius is {loaded_radius!r}; allowed: a number of metres between 0 and 2")
        at = {name: np.array(point) for name, point in self.points.items()}
        self._require(at)
        ball, low, top = at["lower_ball_joint"], at["strut_axis_lower_point"], at["strut_top"]
        axis = _unit(top - low)
        across = _unit(np.cross(axis, [1.0, 0.0, 0.0]))
        self._ball, self._top, self._height = ball, top, at["wheel_centre"][2]
        # Fixed in the knuckle, from the ball joint: tie rod, wheel; across the strut, across, along it.
        self._arms = np.array([at["tie_rod_outer"], at["wheel_centre"]]) - ball
        self._strut = np.array([across, np.cross(axis, across), axis])
        self._offsets = self._strut @ (low - ball)
        self._roots = np.array([at["lower_arm_front_pivot"], at["lower_arm_rear_pivot"], at["tie_rod_inner"]])
        self._lengths = np.linalg.norm(np.array([ball, ball, at["tie_rod_outer"]]) - self._roots, axis=-1)
        self._rack_axis = np.array([0.0, 1.0, 0.0])
        jacobian = self._linkage(ball, np.eye(3), np.zeros(()), np.zeros(()))[1]
        if np.linalg.cond(jacobian[:6]) > LOOSE_CONDITION:
            value = self.points["wheel_centre"]
            raise ValueError(f"wheel_centre is {value}; allowed: where the linkage lets it move up and down")
        self._orientation = np.sign(np.linalg.det(jacobian[:6]))
        # A positive rack coordinate steers left, whether the tie rod is behind the axle or ahead of it.
        self._rack_axis *= np.sign(self._twists(jacobian)[5, 0])

    def __reduce__(self) -> tuple[type["MacPherson"], tuple[Any, ...]]:
        return MacPherson, (dict(self.points), self.loaded_radius)  # a read-only mapping cannot be pickled

    @classmethod
    def load(cls, name: str = "s1") -> "MacPherson":
        """The packaged set ``name``; ValueError lists the packaged sets."""
        if name not in available():
            raise ValueError(f"no strut named {name!r}; packaged: {', '.join(available())}")
        data = json.loads((STRUT_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
        return cls(data["points_m"], data["loaded_radius_m"])

    @staticmethod
    @lru_cache(maxsize=32)
    def packaged(name: str, track: float) -> "MacPherson":
        """:meth:`load` and :meth:`at_track`; itself again when asked for again, as by cars that differ in a value."""
        return MacPherson.load(name).at_track(track)

    def at_track(self, track: float) -> "MacPherson":
        """The same strut moved along y, so that the distance of the wheel centres is ``track`` [m]."""
        if not 0.5 <= track <= 4.0:
            raise ValueError(f"track is {track!r}; allowed: 0.5 to 4 m")
        shift = track / 2 - self.points["wheel_centre"][1]
        return MacPherson({name: (x, y + shift, z) for name, (x, y, z) in self.points.items()}, self.loaded_radius)

    def solve(self, rack: ArrayLike, travel: ArrayLike) -> Pose:
        """Pose of the left wheel, the constraints closed to rounding.

        Parameters
        ----------
        rack : float or array (...)
            Rack displacement, positive steers left [m].
        travel : float or array (...)
            Height of the wheel centre above its design position, bump positive [m].

        Raises
        ------
        ValueError
            A value is not finite or out of reach; the message gives the reachable range.
        """
        rack, travel = np.broadcast_arrays(np.asarray(rack, np.float64), np.asarray(travel, np.float64))
        for name, value in (("rack", rack), ("travel", travel)):
            if (wrong := value[~(np.abs(value) <= FARTHEST)]).size:
                raise ValueError(f"{name} is {wrong[0]}; allowed: finite, at most {FARTHEST} m either way")
        for stride in STRIDES:
            ball, rotation, reached = self._follow(rack, travel, stride)
            if reached.all():
                return self._pose(ball, rotation, rack, travel)
        raise ValueError(self._out_of_reach(rack[~reached].flat[0], travel[~reached].flat[0]))

    @cached_property
    def straight(self) -> Pose:
        """Pose straight ahead at the design height, which every load of a car takes."""
        return self.solve(0.0, 0.0)

    def solve_pair(self, rack: ArrayLike, travel_left: ArrayLike, travel_right: ArrayLike) -> tuple[Pose, Pose]:
        """Poses of the left and the right wheel in car axes; the right strut is the mirror image."""
        return self.solve(rack, travel_left), mirrored(self.solve(-np.asarray(rack, np.float64), travel_right))

    def _require(self, at: dict[str, Array]) -> None:
        """Refuse hard points that do not form a left front strut, each by a distance that must not vanish."""
        centre, front, rear, ball, top, low, outer, inner = (at[name] for name in POINTS)
        swing = np.cross(_unit(front - rear), ball - rear)
        lever = np.cross(outer - ball, _unit(inner - outer)) @ _unit(top - ball)
        needs = {
            "wheel_centre": (centre[1], "y of a left wheel"),
            "strut_top": (top[2] - max(ball[2], low[2]), "height over the rest of the strut"),
            "lower_ball_joint": (np.linalg.norm(swing), "distance from the line of the arm's pivots"),
            "tie_rod_outer": (abs(lever), "lever of the tie rod about the king-pin axis"),
            "tie_rod_inner": (abs(inner[1] - outer[1]), "length of the tie rod along the rack"),
        }
        for name, (value, meaning) in needs.items():
            if not value > SHORTEST:
                raise ValueError(f"{name} is {self.points[name]}: {meaning} {value:.3g} m; allowed: above {SHORTEST} m")

    def _linkage(self, ball: Array, rotation: Array, rack: Array, travel: Array) -> tuple[Array, Array]:
        """Residual (..., 7) [m] and Jacobian (..., 7, 6) of the constraints; the last row is the strut length.

        Rows: arm links, tie rod, strut axis off the top mount twice, wheel height; strut length.
        Columns: velocity of the ball joint, angular velocity of the knuckle.
        """
        tie, wheel = np.moveaxis(self._arms @ np.swapaxes(rotation, -1, -2), -2, 0)
        strut = self._strut @ np.swapaxes(rotation, -1, -2)
        top = self._top - ball
        links = np.stack([ball, ball, ball + tie - rack[..., None] * self._rack_axis], -2) - self._roots
        lengths = np.linalg.norm(links, axis=-1)
        residual = np.empty((*rack.shape, 7))
        force, lever = np.zeros((2, *rack.shape, 7, 3))
        residual[..., :3] = lengths - self._lengths  # (S1), (S2)
        force[..., :3, :] = links / lengths[..., None]
        lever[..., 2, :] = tie
        residual[..., STRUT] = (strut @ top[..., None])[..., 0] - self._offsets  # (S3), (S5)
        force[..., STRUT, :] = -strut
        lever[..., STRUT, :] = top[..., None, :]
        residual[..., 5] = ball[..., 2] + wheel[..., 2] - self._height - travel  # (S4)
        force[..., 5, 2] = 1.0
        lever[..., 5, :] = wheel
        return residual, np.concatenate([force, np.cross(lever, force)], -1)

    def _twists(self, jacobian: Array) -> Array:
        """Velocities of the knuckle (..., 6, 2) per unit rack and per unit travel (implicit function theorem)."""
        given = np.zeros((*jacobian.shape[:-2], 6, 2))
        given[..., 2, 0] = jacobian[..., 2, :3] @ self._rack_axis
        given[..., 5, 1] = 1.0
        return np.linalg.solve(jacobian[..., :6, :], given)

    def _follow(self, rack: Array, travel: Array, stride: float) -> tuple[Array, Array, Array]:
        """Ball joint (..., 3), rotation (..., 3, 3) and whether the pose was reached (...).

        The target moves from the design position by strides of at most ``stride`` [m], with one Newton step for each;
        the iteration then continues to convergence. The path therefore stays on the branch of the design position,
        which the sign of the determinant confirms. A large step means that the path has ended.
        """
        ball = np.broadcast_to(self._ball, (*rack.shape, 3))
        rotation = np.broadcast_to(np.eye(3), (*rack.shape, 3, 3))
        lost = np.zeros(rack.shape, bool)
        farthest = np.abs([rack, travel]).max(initial=0.0)
        moves = max(1, int(np.ceil(farthest / stride)))
        for move in range(1, moves + 12):
            part = min(move / moves, 1.0)
            residual, jacobian = self._linkage(ball, rotation, part * rack, part * travel)
            step = -np.linalg.solve(jacobian[..., :6, :], residual[..., :6, None])[..., 0]
            size = np.abs(step).max(-1)
            lost = lost | ~(size < LARGEST_STEP)
            step[lost] = 0.0
            ball = ball + step[..., :3]
            rotation = _turn(step[..., 3:]) @ rotation
            # Convergence is quadratic: after a step of 1e-9 the error is below rounding.
            if move >= moves and (lost | (size < 1e-9)).all():
                break
        sign = np.sign(np.linalg.det(jacobian[..., :6, :]))
        return ball, rotation, ~lost & (size < 1e-9) & (sign == self._orientation)

    def _out_of_reach(self, rack: float, travel: float) -> str:
        """Message with the range of the rack at this travel, or else of the travel, to 1 mm."""
        scan = np.arange(-300, 301) * 1e-3
        what, reached = f"rack at travel {travel:.4g} m", self._follow(scan, travel + 0 * scan, STRIDES[-1])[2]
        if not reached[300]:
            what, reached = "travel at rack 0", self._follow(0 * scan, scan, STRIDES[-1])[2]
        low, high = scan[:300][~reached[:300]].max(initial=-0.301), scan[301:][~reached[301:]].min(initial=0.301)
        reach = f"{what} from {low + 1e-3:.3f} to {high - 1e-3:.3f} m"
        return f"no pose at rack {rack:.6g} m, travel {travel:.6g} m; reachable: {reach}"

    def _pose(self, ball: Array, rotation: Array, rack: Array, travel: Array) -> Pose:
        """Angles, points and derivatives of a solved knuckle."""
        residual, jacobian = self._linkage(ball, rotation, rack, travel)
        tie, wheel = np.moveaxis(self._arms @ np.swapaxes(rotation, -1, -2), -2, 0)
        spin = rotation[..., 1]
        heading = _unit(np.stack([spin[..., 1], -spin[..., 0], np.zeros_like(rack)], -1))
        left = np.stack([-heading[..., 1], heading[..., 0], np.zeros_like(rack)], -1)
        down = -self.loaded_radius * np.cross(heading, spin)
        contact = ball + wheel + down
        axis = self._top - ball
        pierced = ball + axis * ((contact - ball)[..., 2] / axis[..., 2])[..., None]  # king-pin axis at the ground
        steer, inclination = np.arctan2(heading[..., 1], heading[..., 0]), np.arcsin(spin[..., 2])
        twists = self._twists(jacobian)

        def motion(twist: Array) -> Motion:
            velocity, turn = twist[..., :3], twist[..., 3:]
            centre, contact = velocity + np.cross(turn, wheel), velocity + np.cross(turn, wheel + down)
            return Motion(centre, contact, turn, (jacobian[..., 6, :] * twist).sum(-1))

        return Pose(
            toe=-steer,
            steer_angle=steer,
            camber=-inclination,
            inclination=inclination,
            caster=np.arctan2(-axis[..., 0], axis[..., 2]),
            kingpin_inclination=np.arctan2(-axis[..., 1], axis[..., 2]),
            trail=((pierced - contact) * heading).sum(-1),
            scrub=((contact - pierced) * left).sum(-1),
            wheel_centre=ball + wheel,
            contact=contact,
            rotation=rotation,
            strut_length=residual[..., 6],
            lower_ball_joint=ball,
            strut_top=np.broadcast_to(self._top, ball.shape),
            tie_rod_outer=ball + tie,
            tie_rod_inner=self._roots[2] + rack[..., None] * self._rack_axis,
            per_rack=motion(twists[..., 0]),
            per_travel=motion(twists[..., 1]),
        )


def _checked(points: Mapping[str, ArrayLike]) -> Mapping[str, tuple[float, float, float]]:
    """The hard points as tuples; ValueError names the point, its value and what is allowed."""
    if missing := set(POINTS) - set(points):
        raise ValueError(f"points lack {', '.join(sorted(missing))}; needed: {', '.join(POINTS)}")
    if unknown := set(points) - set(POINTS):
        raise ValueError(f"points hold unknown {', '.join(sorted(unknown))}; allowed: {', '.join(POINTS)}")
    checked = {}
    for name in POINTS:
        try:
            point = np.asarray(points[name], np.float64)
        except (TypeError, ValueError):
            point = np.empty(0)
        if point.shape != (3,) or not (np.abs(point) < 10.0).all():
            raise ValueError(f"{name} is {points[name]!r}; allowed: three finite coordinates within 10 m")
        checked[name] = (float(point[0]), float(point[1]), float(point[2]))
    for one, other in combinations(POINTS, 2):
        distance = np.linalg.norm(np.subtract(checked[one], checked[other]))
        if distance < SHORTEST and {one, other} != {"lower_ball_joint", "strut_axis_lower_point"}:
            raise ValueError(f"{one} is {checked[one]}; allowed: at least {SHORTEST} m from {other} {checked[other]}")
    return MappingProxyType(checked)


def _unit(vector: Array) -> Array:
    """Of length one, along the last axis."""
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def _turn(angle: Array) -> Array:
    """Rotation matrix (..., 3, 3) of a rotation vector (..., 3), by Rodrigues' formula."""
    cross = np.cross(np.eye(3), angle[..., None, :])
    size = np.linalg.norm(angle, axis=-1)[..., None, None]
    return np.eye(3) + np.sinc(size / np.pi) * cross + 0.5 * np.sinc(size / (2 * np.pi)) ** 2 * (cross @ cross)
