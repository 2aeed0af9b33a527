"""The compiled parts of a step: inputs of the plant, rewards and metrics, observation.

A step of all rows runs in compiled code without the GIL, so plain threads can share them:

    advance (scripted inputs and action, then the plant) -> evaluate (observations, reward terms, metrics)

in rounds of at most one update of 10 ms; driver models act before each update. Every kernel works on the rows ``low``
to ``high`` - 1.
"""

import math

from steer_env.episode.timing import SAMPLES_PER_UPDATE, UPDATE_INTERVAL
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.held import call, held
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import definition as tasks
from steer_env.tasks.common.definition import GOES_ON, NON_FINITE, PEAK, RMS, ROLLED_OVER, SPUN_OUT, StepContext
from steer_env.vehicle import plant
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED
from steer_env.vehicle.steering.eps import SAMPLE_TIME

# Rows that go through all rounds of a control step together: 8 to 12 kB each, they stay in the cache of a processor's
# core, from which 1,024 rows drive each other out.
ROWS_AT_ONCE = 64
STEP, BEGIN, TELL = range(3)  # what :func:`step` does
FIRST, LATER, GIVEN = range(3)  # inputs of :func:`advance`: of the first round of a control step, of a later one, given

OVERTURNS = 1.0  # roll angle beyond which a car is taken to overturn [rad]
SLOW = 3.0  # forward speed below which a car that slides sideways has not spun out; assumed [m/s]

_LATERAL_SPEED = plant.CHANNEL["lateral_speed"]
_ROLL = plant.CHANNEL["roll_angle"]


@kernel
def advance(arguments, what, low, high):
    """Fill the plant's inputs for the coming samples unless they are ``GIVEN``, and advance the plant by these.

    ``arguments`` are the arrays, the layout and the outline of a plant. Evaluation, which depends on the task, calls
    this by address, so that the plant is compiled once for all tasks.
    """
    arrays, layout, outline = held(arguments)
    if what != GIVEN:
        _fill_inputs(arrays, layout, what == FIRST, low, high)
    plant.run_rows(
        outline, arrays.plants, arrays.states, arrays.inputs, arrays.channels, arrays.finite, low, high
    )  # fmt: skip


@kernel
def advance_fours(arguments, what, low, high):
    """As :func:`advance`, to the bit, with rows side by side (:func:`steer_env.vehicle.plant.run_fours`)."""
    arrays, layout, outline = held(arguments)
    if what != GIVEN:
        _fill_inputs(arrays, layout, what == FIRST, low, high)
    plant.run_fours(
        outline, layout.common, arrays.plants, arrays.states, arrays.inputs, arrays.channels, arrays.finite, low, high
    )  # fmt: skip


@kernel
def _fill_inputs(arrays, layout, begins, low, high):
    """Fill the plant's inputs for the coming samples; the first call of a control step (``begins``) takes the action.

    The inputs are the scripted ones, straight lines between their updates, plus the action behind its lag. A scripted
    handwheel angle comes with its speed and follows the cubic that meets both at the updates. Once the hands have let
    go, the handwheel is free. A row whose state is not finite keeps the inputs and the previous state that led there.
    """
    for i in range(low, high):
        episode = arrays.episodes[i]
        if begins:
            episode.last_action, episode.action = episode.action, within(arrays.actions[i], -1.0, 1.0)
            episode.action_rate = (episode.action - episode.last_action) / layout.control_dt
            episode.terminated, episode.failure = False, 0
            for k in range(arrays.terms.shape[1]):
                arrays.terms[i, k] = 0.0
        if not arrays.finite[i]:
            continue
        for k in range(arrays.states.shape[1]):
            arrays.previous_states[i, k] = arrays.states[i, k]
        free = episode.release >= 0 and episode.sample >= episode.release
        if free:
            arrays.plants[i, layout.robot] = 0.0
        shares = not math.isnan(arrays.scales[i])
        updates = arrays.factors.shape[1] if shares else arrays.scripted_inputs.shape[1]
        update = within(episode.sample // SAMPLES_PER_UPDATE, 0, updates - 2)  # no round goes beyond it
        place = 0 if shares else update
        start, end = arrays.scripted_inputs[i, place], arrays.scripted_inputs[i, place + 1]
        if shares:
            _script(arrays.factors, arrays.scales[i], update, start)
            _script(arrays.factors, arrays.scales[i], update + 1, end)
        for j in range(arrays.inputs.shape[1]):
            u, sample = arrays.inputs[i, j], episode.sample + j + 1
            for k in range(u.size):
                u[k] = 0.0
            s = (sample - update * SAMPLES_PER_UPDATE) / SAMPLES_PER_UPDATE
            _interpolate(layout.scripted, start, end, s, episode.driven == 0, u)
            if free:
                u[HAND] = 0.0
                u[HAND_SPEED] = 0.0
            asked = layout.action_scale * episode.action_gain * _present_action(layout, episode, sample)
            episode.asked = asked + episode.action_kept * (episode.asked - asked)
            u[layout.action_input] += episode.asked


@kernel
def _script(factors, scale, update, values):
    """Values of a shared script at an update, as :class:`steer_env.tasks.common.definition.Script` has them."""
    for k in range(values.size):
        values[k] = scale * factors[0, update, k] * factors[1, update, k]


@kernel
def _present_action(layout, episode, sample):
    """The action at the end of a sample, whose number since the start of the episode is given."""
    if not layout.ramped:
        return episode.action
    share = ((sample - 1) % layout.samples_per_step + 1) / layout.samples_per_step
    return episode.last_action + share * (episode.action - episode.last_action)


@kernel
def _interpolate(scripted, start, end, s, robot, u):
    """Scripted inputs at a share ``s`` of the interval between two updates; places among the inputs u: ``scripted``.

    A handwheel angle of a ``robot`` comes with its speed.
    """
    for k in range(scripted.size):
        u[scripted[k]] = start[k] + s * (end[k] - start[k])
    if robot and scripted.size > 1 and scripted[1] == HAND_SPEED:  # angles and speeds of both ends
        begin_slope, end_slope = start[1] * UPDATE_INTERVAL, end[1] * UPDATE_INTERVAL
        u[HAND], slope = hermite(s, start[0], end[0], begin_slope, end_slope)
        u[HAND_SPEED] = slope / UPDATE_INTERVAL


@kernel
def step(arguments, what, told, low, high):
    """Take rows through a control step, begin their episodes (``BEGIN``), or ``TELL`` what infos are made of.

    Parameters
    ----------
    arguments : of :class:`steer_env.friction.numerics.held.Holder`
        Arrays, scores, layout, the task's parameters, whether each episode is over (n,), its conditions (n, D), and the
        kernels of drivers and plant as ``Called``.
    what : {STEP, BEGIN, TELL}
    told : (K, n) array
        Receives channels, terms, metrics, cost, failure and conditions of the rows; (0, n) for nothing.

    Returns
    -------
    int
        How many episodes the step ended, which are over then; or -1 where an action of any row is not finite, and
        nothing was done.
    """
    arrays, scores, layout, parameters, over, conditions, drivers, cars = held(arguments)
    if what == STEP:
        for i in range(arrays.actions.size):
            if not abs(arrays.actions[i]) < math.inf:
                return -1
    rounds = 0 if what == TELL else layout.rounds if what == STEP else 1
    ended = 0
    for first in range(low, high, ROWS_AT_ONCE):
        last = min(first + ROWS_AT_ONCE, high)
        for k in range(rounds):
            if what == STEP:
                if drivers.function != 0:
                    call(drivers.function, drivers.arguments, 0, first, last)
                call(cars.function, cars.arguments, FIRST if k == 0 else LATER, first, last)
            samples = layout.samples_per_round if what == STEP else 0
            _evaluate(arrays, scores, layout, parameters, samples, k == rounds - 1, what == BEGIN, first, last)
        if what == STEP:
            ended += _end(arrays.episodes, over, first, last)
        if told.shape[0] > 0:
            _tell(arrays, conditions, told, first, last)
    return ended


@kernel
def _end(episodes, over, low, high):
    """Note whose episodes ended in a step, and count them."""
    ended = 0
    for i in range(low, high):
        if not over[i] and (episodes[i].terminated or episodes[i].truncated):
            over[i] = True
            ended += 1
    return ended


@kernel
def _tell(arrays, conditions, told, low, high):
    """Write what infos are made of, in the order of :func:`step`; line by line, as lines of many rows lie far apart."""
    n = 0
    for values in (arrays.channels, arrays.terms):
        for k in range(values.shape[1]):
            for i in range(low, high):
                told[n + k, i] = values[i, k]
        n += values.shape[1]
    for k in range(arrays.metrics.shape[2]):
        for i in range(low, high):
            told[n + k, i] = arrays.metrics[i, 2, k]
    n += arrays.metrics.shape[2]
    for i in range(low, high):
        told[n, i], told[n + 1, i] = arrays.episodes[i].cost, arrays.episodes[i].failure
    for k in range(conditions.shape[1]):
        for i in range(low, high):
            told[n + 2 + k, i] = conditions[i, k]


@kernel
def _evaluate(arrays, scores, layout, parameters, samples, ends, begins, low, high):
    """Advance the time by ``samples``, observe, and evaluate; the last call of a control step (``ends``) finishes it.

    ``parameters`` are the task's; their class selects its kernels, which write the ``scores`` by name. Rows whose
    episode has ended or whose state is not finite are not evaluated. With no samples, only the observations are
    updated; where an episode ``begins``, a delayed observation shows its start until newer ones come.
    """
    dt = samples * SAMPLE_TIME
    for i in range(low, high):
        episode, channels, observed = arrays.episodes[i], arrays.channels[i], arrays.task_observations[i]
        episode.sample += samples
        if layout.speed_channel >= 0:
            episode.speed = channels[layout.speed_channel]
        step = StepContext(
            episode.sample * SAMPLE_TIME, dt, episode.speed, episode.held_speed, episode.action, episode.action_rate,
            episode.asked,
        )  # fmt: skip
        data, memory = arrays.task_data[i, : episode.data_size], arrays.task_memory[i]
        tasks.observe(parameters, channels, arrays.paths[i, : episode.path_points], data, step, memory, observed)
        if samples > 0 and arrays.finite[i] and not episode.terminated:
            episode.evaluated += samples
            rewards, costs, metrics = scores.rewards[i], scores.costs[i], scores.metrics[i]
            outcome = tasks.evaluate_step(parameters, channels, observed, data, step, memory, rewards, costs, metrics)
            episode.terminated, episode.failure = outcome != GOES_ON, max(outcome, 0)
            _accumulate(layout.metric_kinds, dt, arrays.metrics[i, 0], arrays.metrics[i, 1])
        if ends:
            _finish_step(layout, episode, channels, arrays.finite[i], arrays.terms[i])
            _conclude(layout.metric_kinds, episode.evaluated * SAMPLE_TIME, arrays.metrics[i, 1], arrays.metrics[i, 2])
            past = arrays.past_observations[i]
            _observe(layout, episode, channels, observed, arrays.noise[i], past)
            if begins:
                for j in range(past.shape[0]):
                    for k in range(past.shape[1]):
                        past[j, k] = past[episode.latest, k]
            delayed = (episode.latest - episode.delay) % past.shape[0]
            for k in range(layout.bounds.size):
                arrays.observations[i, k] = past[delayed, k] / layout.scales[k]
            own = layout.observed_channels.size + 1  # a controller knows its last action without delay
            arrays.observations[i, own] = past[episode.latest, own] / layout.scales[own]


@kernel
def _accumulate(kinds, dt, present, accumulated):
    """Take the present values (F,) of the metrics into what has accumulated: largest size, mean square, or sum."""
    for k in range(kinds.size):
        size = abs(present[k])
        if kinds[k] == PEAK:
            if size > accumulated[k]:
                accumulated[k] = size
        else:
            accumulated[k] += dt * size * size if kinds[k] == RMS else size


@kernel
def _conclude(kinds, time, accumulated, so_far):
    """The metrics (F,) of the time [s] that has been evaluated; zero before any."""
    for k in range(kinds.size):
        so_far[k] = math.sqrt(accumulated[k] / time) if kinds[k] == RMS and time > 0.0 else accumulated[k]


@kernel
def _finish_step(layout, episode, channels, finite, terms):
    """Weight the terms, and decide whether the episode ends; what comes after the task's own end does not count."""
    episode.truncated = episode.sample + layout.samples_per_step > episode.end or episode.sample >= layout.time_limit
    if not episode.terminated:
        episode.failure = _failure(episode, channels, finite, terms)
        episode.terminated = episode.failure > 0
    if episode.failure == NON_FINITE:  # nor are its terms
        for k in range(terms.size):
            terms[k] = 0.0
    failure = layout.n_rewards - 1  # the last reward
    episode.reward = episode.cost = 0.0
    for k in range(terms.size):
        terms[k] *= layout.weights[k]
        if k == failure:
            terms[k] = layout.weights[k] if episode.failure > 0 else 0.0
        if k <= failure:
            episode.reward += terms[k]
        else:
            episode.cost += terms[k]


@kernel
def _failure(episode, channels, finite, terms):
    """The failure of an episode that its task lets go on; 0 for none."""
    total = 0.0
    for k in range(terms.size):
        total += terms[k]
    if not finite or not abs(total) < math.inf:
        return NON_FINITE
    if abs(channels[_ROLL]) > OVERTURNS:
        return ROLLED_OVER
    if abs(channels[_LATERAL_SPEED]) > within(episode.speed, SLOW, math.inf):
        return SPUN_OUT
    return 0


@kernel
def _observe(layout, episode, channels, observed, noise, past_observations):
    """Put the present observation into the ring buffer (D, O): with noise, and clipped to the bounds."""
    episode.latest = (episode.latest + 1) % past_observations.shape[0]
    n = layout.observed_channels.size
    for k in range(layout.bounds.size):
        if k < n:
            value = channels[layout.observed_channels[k]]
        elif k == n:
            value = episode.speed
        elif k == n + 1:
            value = episode.action
        else:
            value = observed[k - n - 2]
        value += noise[k]
        # NaN of a failed row becomes zero.
        clipped = within(value, -layout.bounds[k], layout.bounds[k]) if abs(value) <= math.inf else 0.0
        past_observations[episode.latest, k] = clipped
