"""Friction laws in joints of a MuJoCo model, by the step equation (F7).

MuJoCo holds a torque that is applied to a joint constant over a step. A friction torque computed from the speed before
the step then chatters or creeps, and so does ``frictionloss``, a soft constraint. Here the torque is that at the speed
*after* the step, with which MuJoCo moves the positions. Its integrators give, for a torque -T at the joints with
friction,

    v_+ = v_* - h G T,    G = E' (M + h D)^-1 E,

with v_* the speeds that the step would end with if there were no friction, M the inertia with armature, D what the
integrator takes implicitly (damping; with ``implicit`` and ``implicitfast`` also actuators), and E the columns of these
joints. With A = (h G)^-1 this is A w + T(w) = A v_*: for one joint the step equation with S = A, and for several one
such equation each, S = A_ii, solved in turn until they agree. Where every T grows with the speed this is the descent
along the coordinates of a convex function, which converges. Both v_* and G are taken from MuJoCo's own integrator, on a
copy of the data.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import law_of, resolve, step
from steer_env.friction.numerics.extras import install
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import bind

PASSES = 2000  # over the joints, at most
ROUNDS = 10  # of friction and constraints in turn, in a step with active constraints
AGREED = 1e-13  # change of the torque in a pass, relative to the largest torque that drives [1]


class JointFriction:
    """Friction of joints; its :meth:`step` takes the place of ``mujoco.mj_step``.

    Without active constraints the step is exact: the joint moves with the speed that the law was solved for, a joint
    under a load that its law holds stays at rest to rounding, and friction takes from the motion at least what the law
    stores. While contacts, limits, equalities or tendon friction act, friction and constraints are computed in turn,
    ten times at most in a step and from the torque of the step before: what rests still comes to hold, to the tolerance
    of MuJoCo's solver, but in a fast motion an error is left, and no bound of the energy is stated.

    It belongs to one ``MjData``, as the memory of a law belongs to the motion.

    Parameters
    ----------
    model : mujoco.MjModel
        Its integrator is Euler, implicit or implicitfast, without sleeping. The step may change between steps.
    laws : mapping of str
        Name of a hinge or slide joint -> its law, in any form that ``friction.make`` or a car takes: parameters, or
        text as ``"lugre,F_c=1.0"``. Torques [N m] and angles [rad] are forces [N] and distances [m] at a slide.

    Raises
    ------
    ValueError
        Without the package mujoco; for a joint that the model does not have, of another kind, or with ``frictionloss``
        of its own; for a law that is none; for another integrator.
    """

    def __init__(self, model: Any, laws: Mapping[str, Any]) -> None:
        try:
            import mujoco  # here, because it is an extra
        except ImportError:
            raise ValueError(f"friction of joints needs the package mujoco: {install('mujoco')}") from None
        self._mujoco: Any = mujoco
        self._model = model
        if not laws:
            raise ValueError("laws must name at least one joint, got none")
        if not isinstance(laws, Mapping):
            raise ValueError(f"laws must be a mapping of joints, got {laws!r}")
        self._dofs = np.array([self._dof(name) for name in laws])
        self._integrator()
        self.laws = {name: _law(name, law) for name, law in laws.items()}  # parameters by joint
        self._memories = [np.zeros(law_of(p).memory_size(p)) for p in self.laws.values()]
        self._trials = [memory.copy() for memory in self._memories]
        self._steps = [bind(step, p, 1.0, m, 1.0, 0.0, 1e-3, 0.0) for p, m in zip(self.laws.values(), self._memories)]
        self._w, self._T = np.zeros((2, len(laws)))
        self._falls: tuple[float, NDArray[np.float64]] = (0.0, np.zeros(len(laws)))
        self._scratch = self._mujoco.MjData(model)

    @property
    def torque(self) -> dict[str, float]:
        """Mean friction torque of the last step by joint, which resists positive motion [N m]."""
        return dict(zip(self.laws, self._T.tolist()))

    def reset(self) -> None:
        """Forget the motion: every law is at rest and unloaded, as after ``mujoco.mj_resetData``."""
        for memory in self._memories:
            memory[:] = 0.0
        self._w[:] = self._T[:] = 0.0

    def step(self, data: Any) -> None:
        """Advance ``data`` by one step with friction; controls and applied forces are those that it holds.

        Afterwards ``qfrc_applied`` is as before, so that a later ``mj_forward`` computes forces without friction.

        Raises
        ------
        ValueError
            If the step is too long for a law whose torque falls with the speed.
        RuntimeError
            If the equations of several joints do not agree, a speed is not finite, or MuJoCo resets ``data``, which it
            does where they are not finite, or huge; :meth:`reset` then begins anew.
        """
        mj, model, dofs, h = self._mujoco, self._model, self._dofs, self._model.opt.timestep
        begin, warned = data.time, self._resets(data)
        mj.mj_step1(model, data)
        own = data.qfrc_applied[dofs].copy()
        data.qfrc_applied[dofs] = own - self._T  # the constraints begin with the friction of the last step
        try:
            mj.mj_fwdActuation(model, data)
            hG = h * np.column_stack([self._response(data, dof) for dof in dofs])
            A = np.linalg.inv(hG)
            self._check(A, h)
            for _ in range(ROUNDS):
                mj.mj_fwdAcceleration(model, data)
                mj.mj_fwdConstraint(model, data)
                v = self._advanced(data, data.qfrc_smooth + data.qfrc_constraint)[dofs]
                before = self._T.copy()
                self._solve(A, A @ (v + hG @ self._T), h)
                data.qfrc_applied[dofs] = own - self._T
                if data.nefc == 0 or np.abs(self._T - before).max() <= AGREED * np.abs(self._T).max():
                    break
            mj.mj_step2(model, data)
        finally:
            data.qfrc_applied[dofs] = own
        if data.time <= begin or self._resets(data) > warned:
            raise RuntimeError(f"MuJoCo has reset its data at {begin:g} s, as they were not finite, or huge")
        for memory, trial in zip(self._memories, self._trials):
            memory[:] = trial

    def _resets(self, data: Any) -> int:
        """Number of warnings beside which MuJoCo resets its data."""
        kinds = self._mujoco.mjtWarning
        return sum(
            data.warning[int(k)].number for k in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        )

    def _solve(self, A: NDArray, b: NDArray, h: float) -> None:
        """Speeds and torques with A w + T = b; the trial memories are those after the step."""
        w, T = self._w, self._T
        if not np.isfinite(b).all():
            raise RuntimeError(f"the speed of joint {list(self.laws)[int(np.argmin(np.isfinite(b)))]!r} is not finite")
        allowed = AGREED * np.abs(b).max()
        for _ in range(PASSES):
            change = 0.0
            for i, p in enumerate(self.laws.values()):
                trial, S, last = self._trials[i], A[i, i], w[i]
                trial[:] = self._memories[i]
                w[i], T[i] = self._steps[i](p, 1.0, trial, S, b[i] - A[i] @ w + S * last, h, last)  # (F7)
                change = max(change, S * abs(w[i] - last))
            if change <= allowed or len(w) == 1:
                return
        raise RuntimeError(f"the joints {', '.join(self.laws)} do not agree on their speeds in {PASSES} passes")

    def _advanced(self, data: Any, force: NDArray) -> NDArray[np.float64]:
        """Speeds after a step with these forces in place of those of ``data``, by MuJoCo's own integrator."""
        scratch, model = self._scratch, self._model
        self._mujoco.mj_copyData(scratch, model, data)
        scratch.qfrc_smooth[:] = force
        scratch.qfrc_constraint[:] = 0.0
        self._mujoco.mj_solveM(model, scratch, scratch.qacc[None], force[None])
        self._integrator()(model, scratch)
        return scratch.qvel.copy()

    def _response(self, data: Any, dof: int) -> NDArray[np.float64]:
        """Column of G: change of the speeds over a step, in relation to it, by a torque of 1 at one joint."""
        unit = np.zeros(self._model.nv)
        unit[dof] = 1.0
        return (self._advanced(data, unit) - data.qvel)[self._dofs] / self._model.opt.timestep

    def _integrator(self) -> Any:
        """The function of MuJoCo's integrator, which begins with the forces and ends with the new state."""
        mj, option = self._mujoco, self._model.opt
        if option.enableflags & int(mj.mjtEnableBit.mjENBL_SLEEP):
            raise ValueError("the model's flag sleep must be disabled for friction of joints, got enabled")
        kinds = mj.mjtIntegrator
        kind = kinds(option.integrator)
        if kind == kinds.mjINT_EULER:
            return mj.mj_Euler
        if kind in (kinds.mjINT_IMPLICIT, kinds.mjINT_IMPLICITFAST):
            return mj.mj_implicit
        raise ValueError(f"the model's integrator must be Euler, implicit or implicitfast, got {kind.name}")

    def _dof(self, name: str) -> int:
        """Index of the speed of a joint that may have friction."""
        mj, model = self._mujoco, self._model
        joint = mj.mj_name2id(model, mj.mjtObj.mjOBJ_JOINT, str(name))
        allowed = (int(mj.mjtJoint.mjJNT_HINGE), int(mj.mjtJoint.mjJNT_SLIDE))
        if joint < 0 or model.jnt_type[joint] not in allowed:
            names = [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] in allowed]
            raise ValueError(f"a joint must be a hinge or slide joint of the model ({', '.join(names)}), got {name!r}")
        dof = int(model.jnt_dofadr[joint])
        loss = model.dof_frictionloss[dof]
        if loss != 0.0:
            raise ValueError(f"frictionloss of joint {name!r} must be 0 beside a friction law, got {loss:g}")
        return dof

    def _check(self, A: NDArray, h: float) -> None:
        """Refuse a plant whose step equations may have more than one solution."""
        if self._falls[0] != h:
            self._falls = h, np.array([law_of(p).steepest_fall(p, 1.0, h) for p in self.laws.values()])
        falls = self._falls[1]
        if falls.any() and np.linalg.eigvalsh(0.5 * (A + A.T) - np.diag(falls)).min() <= 0.0:
            worst = int(np.argmax(falls - A.diagonal()))
            raise ValueError(
                f"timestep {h:g} s is too long for the law of joint {list(self.laws)[worst]!r}: its torque falls by up "
                f"to {falls[worst]:.3g} N m s/rad, and the inertia over the step, {A[worst, worst]:.3g}, must "
                "be more; take a shorter step, armature, or a law with less fall"
            )


def _law(name: str, law: Any) -> Any:
    try:
        return frozen(resolve(law))
    except ValueError as error:
        raise ValueError(f"joint {name!r}: {error}") from None
