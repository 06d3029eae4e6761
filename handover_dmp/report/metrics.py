# Copyright 2026 The handover_dmp authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Measures of a run: distances, speeds, lags, timing and use of the limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.quaternions import to_matrix
from handover_dmp.mocap.measures import ACTIVE_SPEED
from handover_dmp.report.motion import bell_of, RATE_HZ, resample, velocity
from handover_dmp.report.recorded_run import RecordedLimits, RunRecord
from handover_dmp.topics import DIAGNOSTICS, HAND_TRUTH
import numpy as np

# above this goal weight the wrist only follows the hand
FEEDBACK_WEIGHT = 0.99
# below this speed, noise of a hand at rest would count as motion
MIN_HAND_SPEED = 0.05
MIN_FEEDBACK_SAMPLES = 20
# a lag with a larger standard error counts as unknown
LARGEST_LAG_ERROR_S = 0.01
# decay rates, 1/s, of springs that reach their goal within 1 s and within 0.05 s
DECAYS = np.geomspace(3.0, 60.0, 60)
# below the resolution of any tracker or arm
RESOLUTION_M = 1e-5
UNIT_NORM = 1e-3
"""Tolerance of the norm of a unit quaternion."""
# topics with fewer messages are no streams
MIN_RATE_SAMPLES = 10
# share of the limit; measured joint states contain noise of the simulator or the encoders
LIMIT_TOLERANCE = 0.01
# limits lose digits when they are written as text
BELIEF_TOLERANCE = 1e-6

Numbers = dict[str, Any]

PERFECT_M = 1e-5
FUSED = 'fused'
"""Name of the fused estimate among the names of the trackers."""


def measure(run: RunRecord) -> Numbers:
    """
    Measure a run.

    Args:
        run: the run.

    Returns:
        Plain types, for JSON; names include their units; None if a value is unknown.

    """
    return {
        'handed_over': run.handed_over,
        'states': [{'time_s': time_s, 'state': state} for time_s, state in run.states],
        **_durations(run),
        **_exchange(run),
        **_against_demonstration(run),
        **_carried(run),
        **_speeds(run),
        'lag': lag_behind_hand(run),
        'arm_lag': lag_behind_command(run),
        'to_human': _to_demonstrator(run),
        'limits': joint_limits(run),
        **_hand_age(run),
        'trackers': tracker_errors(run),
        'inverse_kinematics': _inverse_kinematics(run),
        'topics': topic_rates(run),
        'nodes': node_status(run),
    }


def goal_at(run: RunRecord, times: Array) -> Array:
    """
    Return the goal of the wrist: the hand plus the learnt goal offset.

    Args:
        run: the run.
        times: (n,) s.

    Returns:
        (n, 3) m.

    """
    goal: Array = resample(run.hand_times, run.hand_positions, times) + run.goal_offset
    return goal


def lag_behind_hand(run: RunRecord) -> Numbers:
    """
    Find the lag of the wrist behind the hand while it follows the hand.

    With the goal g(t) and a wrist that lags by L, x(t) = g(t − L); for small lags, g − x = L ġ.
    The distance that remains when the goal takes over decays like a critically damped spring and
    is no lag. L is therefore fitted together with this decay, g − x = L ġ + (a + b t) exp(−ω t),
    by least squares over all axes and samples of the feedback phase, up to the end of the
    exchange: goal weight at least 0.99, and hand faster than 0.05 m/s.

    Args:
        run: the run.

    Returns:
        `time_ms`, its standard error `error_ms`, `distance_mm` at the mean speed of the hand
        `hand_speed_m_s`, and the number of `samples`; None if the hand did not move, or too
        briefly to know the lag to 10 ms.

    """
    unknown = dict.fromkeys(('time_ms', 'error_ms', 'distance_mm', 'hand_speed_m_s'))
    nothing: Numbers = {**unknown, 'samples': 0}
    times, speeds = velocity(run.hand_times, run.hand_positions)
    if 'goal_weight' not in run.phase or not len(times):
        return nothing
    weight = np.interp(times, run.phase_times, run.phase['goal_weight'])
    begin, end = run.handover_span_s
    moving = np.linalg.norm(speeds, axis=1) > MIN_HAND_SPEED
    chosen = (weight >= FEEDBACK_WEIGHT) & moving & (times >= begin) & (times <= end)
    if chosen.sum() < MIN_FEEDBACK_SAMPLES:
        return nothing
    times, speeds = times[chosen], speeds[chosen]
    behind = goal_at(run, times) - resample(run.wrist_times, run.wrist_positions, times)
    lag_s, error_s = _fit_lag(times - times[0], behind, speeds)
    if error_s > LARGEST_LAG_ERROR_S:
        return nothing
    speed = float(np.linalg.norm(speeds, axis=1).mean())
    return {
        'time_ms': lag_s * 1e3,
        'error_ms': error_s * 1e3,
        'distance_mm': lag_s * speed * 1e3,
        'hand_speed_m_s': speed,
        'samples': int(chosen.sum()),
    }


def lag_behind_command(run: RunRecord) -> Numbers:
    """
    Find the lag of the measured wrist behind its command c.

    It is the slope L of c − x = L ċ, over all axes and samples from the start of the reach to the
    end of the exchange in which the command is faster than 0.05 m/s.

    Args:
        run: the run.

    Returns:
        `time_ms`, and `rms_mm` and `largest_mm` of the distance; None if no command was recorded
        or it does not move.

    """
    nothing: Numbers = {'time_ms': None, 'rms_mm': None, 'largest_mm': None}
    times, speeds = velocity(run.command_times, run.command_positions)
    begin, end = run.handover_span_s
    chosen = (times >= begin) & (times <= end)
    chosen &= np.linalg.norm(speeds, axis=1) > MIN_HAND_SPEED
    if chosen.sum() < MIN_FEEDBACK_SAMPLES:
        return nothing
    times, speeds = times[chosen], speeds[chosen]
    command = resample(run.command_times, run.command_positions, times)
    behind = command - resample(run.wrist_times, run.wrist_positions, times)
    distances = np.linalg.norm(behind, axis=1) * 1e3
    return {
        'time_ms': float((behind * speeds).sum() / (speeds * speeds).sum()) * 1e3,
        'rms_mm': float(np.sqrt((distances**2).mean())),
        'largest_mm': float(distances.max()),
    }


def _fit_lag(times: Array, behind: Array, speeds: Array) -> tuple[float, float]:
    """
    Fit behind = lag · speed + (a + b t) exp(−ω t); return the lag and its standard error, s.

    Several decays ω may explain a short stretch equally well, with different lags. The lag is
    therefore the mean over all ω, weighted by likelihood, and its error includes their spread.
    """
    target = behind.T.ravel()
    lags, variances, rests = [], [], []
    for decay in DECAYS:
        fading = np.exp(-decay * times)
        dying = np.kron(np.eye(3), np.column_stack([fading, times * fading]))
        matrix = np.column_stack([speeds.T.ravel(), dying])
        found = np.linalg.lstsq(matrix, target, rcond=None)[0]
        rests.append(target - matrix @ found)
        lags.append(found[0])
        variances.append(np.linalg.pinv(matrix.T @ matrix)[0, 0])
    squares = np.array([(rest**2).mean() for rest in rests]) + RESOLUTION_M**2
    best = rests[int(np.argmin(squares))].reshape(3, -1)
    # errors of neighbours are correlated, so there are fewer independent samples
    alike = float((best[:, 1:] * best[:, :-1]).sum() / ((best**2).sum() + 1e-30))
    independent = len(target) * (1 - alike) / (1 + alike)
    weights = (squares / squares.min()) ** (-independent / 2)
    weights /= weights.sum()
    lag = float(weights @ lags)
    own = np.array(variances) * squares * len(target) / independent
    return lag, float(np.sqrt(weights @ (own + (np.array(lags) - lag) ** 2)))


def joint_limits(run: RunRecord) -> Numbers:
    """
    Compare the joint states with the limits of the arm, from its recorded description.

    Accelerations are difference quotients of successive measured velocities.

    Args:
        run: the run.

    Returns:
        For `position`, `velocity` and `acceleration`: the greatest share of the limit that was
        used (`share`, 1 at the limit), the joint, and whether the limit was kept (`met`, with 1 %
        for measurement noise); `met` for all; None if the limits are unknown. Joints without a
        limit, such as continuous ones, do not count. `judged_by` is the topic of the limits,
        `sources` the origin of each, `believed_beyond` the joints for which the controller
        assumed wider limits, with both numbers.

    """
    limits = run.joint_limits
    if limits is None:
        nothing = dict.fromkeys(('met', 'position', 'velocity', 'acceleration', 'judged_by'))
        return {**nothing, 'sources': {}, 'believed_beyond': []}
    ends = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    lower, upper = np.where(ends, (limits.lower, limits.upper), np.nan)
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    steps = np.diff(run.joint_times)[:, None]
    accelerations = np.diff(run.joint_velocities, axis=0) / steps
    quantities = {
        'position': (np.abs(run.joint_positions - middle), half),
        'velocity': (np.abs(run.joint_velocities), limits.velocity),
        'acceleration': (np.abs(accelerations), limits.acceleration),
    }
    found: Numbers = {
        name: _most_used(run.joint_names, values, bound)
        for name, (values, bound) in quantities.items()
    }
    known = [one['met'] for one in found.values() if one is not None]
    return {
        'met': all(known) if known else None,
        **found,
        'judged_by': limits.origin,
        'sources': limits.sources,
        'believed_beyond': _believed_beyond(run, limits),
    }


def _believed_beyond(run: RunRecord, limits: RecordedLimits) -> list[str]:
    """Name the limits that the controller assumed to be wider than they are."""
    believed, found = run.believed_limits, []
    if believed is None or believed is limits:
        return []
    for quantity, unit, sign in (
        ('lower', 'rad', -1.0),
        ('upper', 'rad', 1.0),
        ('velocity', 'rad/s', 1.0),
        ('acceleration', 'rad/s²', 1.0),
    ):
        for name, true, told in zip(
            run.joint_names, getattr(limits, quantity), getattr(believed, quantity), strict=True
        ):
            beyond = sign * (told - true) > BELIEF_TOLERANCE * abs(true)
            if beyond or (np.isnan(told) and np.isfinite(true)):
                found.append(f'{quantity} of {name}: assumed {told:.4g} {unit}, actual {true:.4g}')
    return found


def _most_used(names: Sequence[str], values: Array, bound: Array) -> Numbers | None:
    limited = np.flatnonzero(np.isfinite(bound) & (bound > 0))
    if not len(limited):
        return None
    shares = values[:, limited].max(axis=0) / bound[limited]
    worst = int(np.argmax(shares))
    return {
        'share': float(shares[worst]),
        'joint': names[limited[worst]],
        'met': bool(shares[worst] <= 1.0 + LIMIT_TOLERANCE),
    }


def topic_rates(run: RunRecord) -> dict[str, Numbers]:
    """
    Find the rate and the jitter of every periodic topic.

    Args:
        run: the run.

    Returns:
        By topic: `count`; `rate_hz`; the median period `period_ms`; the distance of periods from
        the median, `jitter_median_ms` and `jitter_99_ms`; the longest period `longest_ms`; all by
        stamps, and by arrival `arrival_jitter_99_ms`. Messages with equal stamps count once,
        except in the first and the last figure: in lockstep a message is repeated until it is
        answered.

    """
    found = {}
    for topic, stamps in sorted(run.stamps.items()):
        if topic == DIAGNOSTICS.name:
            # all nodes publish there, each on its own clock
            continue
        periods = np.diff(np.unique(stamps)) * 1e3
        if len(stamps) < MIN_RATE_SAMPLES or periods.sum() <= 0:
            continue
        errors = np.abs(periods - np.median(periods))
        arrivals = np.diff(np.sort(run.arrivals[topic])) * 1e3
        found[topic] = {
            'count': len(stamps),
            'rate_hz': float(len(periods) / periods.sum() * 1e3),
            'period_ms': float(np.median(periods)),
            'jitter_median_ms': float(np.median(errors)),
            'jitter_99_ms': float(np.percentile(errors, 99)),
            'longest_ms': float(periods.max()),
            'arrival_jitter_99_ms': float(
                np.percentile(np.abs(arrivals - np.median(arrivals)), 99)
            ),
        }
    return found


def node_status(run: RunRecord) -> dict[str, Numbers]:
    """
    Summarise the diagnostics of the nodes.

    Args:
        run: the run.

    Returns:
        By node: the number of its `reports`, its `faults` in order and its last `values`.

    """
    found: dict[str, Numbers] = {}
    for status in run.diagnostics:
        node = found.setdefault(status.node, {'reports': 0, 'faults': [], 'values': {}})
        node['reports'] += 1
        node['values'] = dict(status.values)
        if status.level and status.message not in node['faults']:
            node['faults'].append(status.message)
    return found


def _durations(run: RunRecord) -> Numbers:
    begin, exchange_s, done = (run.time_of(name) for name in ('reaching', 'exchange', 'done'))
    reach = exchange_s - begin if begin is not None and exchange_s is not None else None
    handover = done - begin if begin is not None and done is not None else None
    return {
        'duration_s': run.end_time_s,
        'reach_duration_s': reach,
        'handover_duration_s': handover,
        'simulated_clock': run.simulated_clock,
    }


def _exchange(run: RunRecord) -> Numbers:
    span = run.exchange_span_s
    if span is None:
        return {'exchange_time_s': None, 'exchange_gap_m': None, 'exchange_gap_least_m': None}
    times = np.append(span[0], run.wrist_times[(run.wrist_times > span[0])])
    times = times[times <= max(span)]
    wrist = resample(run.wrist_times, run.wrist_positions, times)
    gaps = np.linalg.norm(goal_at(run, times) - wrist, axis=1)
    return {
        'exchange_time_s': span[0],
        'exchange_gap_m': float(gaps[0]),
        'exchange_gap_least_m': float(gaps.min()),
    }


def _against_demonstration(run: RunRecord) -> Numbers:
    """
    Compare the hand's distance with the demonstration, and measure the overshoot of the wrist.

    Both are measured along the line from the start of the wrist to the goal.
    """
    begin, end = run.handover_span_s
    times = run.wrist_times[(run.wrist_times >= begin) & (run.wrist_times <= end)]
    if run.reaching_time_s is None or len(times) < 2:
        return {'hand_distance_share': None, 'beyond_goal_max_m': None}
    goals, wrist = goal_at(run, times), resample(run.wrist_times, run.wrist_positions, times)
    line = goals - wrist[0]
    distance = np.linalg.norm(line, axis=1)
    line /= np.maximum(distance, RESOLUTION_M)[:, None]
    learnt, exchange_s = run.learnt_distance_m, run.exchange_time_s
    met = -1 if exchange_s is None else int(np.searchsorted(times, exchange_s))
    return {
        'hand_distance_share': float(distance[met] / learnt) if learnt else None,
        'beyond_goal_max_m': float(((wrist - goals) * line).sum(axis=1).max()),
    }


def _carried(run: RunRecord) -> Numbers:
    """
    Measure the orientation of the carried object, as far as its task demands one.

    For an object that shall stay upright: the largest tilt from the start of the reach on,
    relative to the start of the run, deg. For one that shall point at the hand: the angle between
    the two at the start of the exchange, deg.
    """
    known = run.info.get('object')
    found: Numbers = {
        'object': known.get('name') if isinstance(known, dict) else None,
        'object_tilt_max_deg': None,
        'handle_angle_deg': None,
    }
    task, begin, span = run.info.get('orientation'), run.reaching_time_s, run.exchange_span_s
    norms = np.linalg.norm(run.wrist_quaternions, axis=1)
    if begin is None or not (np.abs(norms - 1.0) < UNIT_NORM).all():
        return found
    if task in ('upright', 'level'):
        first = to_matrix(run.wrist_quaternions[0]).T[:, 2]
        reach = run.wrist_quaternions[run.wrist_times >= begin]
        heights = [(to_matrix(turn) @ first)[2] for turn in reach.tolist()]
        found['object_tilt_max_deg'] = float(np.degrees(np.arccos(min(1.0, min(heights)))))
    elif task == 'point' and span is not None:
        at = int(np.searchsorted(run.wrist_times, span[0]).clip(0, len(norms) - 1))
        hand = resample(run.hand_times, run.hand_positions, run.wrist_times[[at]])
        way = hand[0] - run.wrist_positions[at]
        axis = to_matrix(run.wrist_quaternions[at])[:, 2]
        cosine = float(axis @ way) / max(float(np.linalg.norm(way)), RESOLUTION_M)
        found['handle_angle_deg'] = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return found


def _speeds(run: RunRecord) -> Numbers:
    found: Numbers = {}
    for name, times, positions in (
        ('wrist', run.wrist_times, run.wrist_positions),
        ('hand', run.hand_times, run.hand_positions),
        ('human', run.demonstrator_times, run.demonstrator_positions),
    ):
        even, velocities = velocity(times, positions)
        speeds = np.linalg.norm(velocities, axis=1)
        found[f'{name}_peak_speed_m_s'] = float(speeds.max()) if len(speeds) else None
        if name == 'wrist':
            found['wrist_from_minimum_jerk_share'] = _from_bell(run, even, speeds)
    if len(run.twist_velocities):
        commanded = np.linalg.norm(run.twist_velocities, axis=1)
        found['command_peak_speed_m_s'] = float(commanded.max())
    return found


def _from_bell(run: RunRecord, times: Array, speeds: Array) -> float | None:
    """RMS difference of the reach from the fitted minimum-jerk speed, as a share of its peak."""
    bell = bell_of(times, speeds, run.exchange_time_s)
    if bell is None:
        return None
    reach = (times >= bell.begin_s) & (times <= bell.begin_s + bell.duration_s)
    miss = speeds[reach] - bell.speed(times[reach])
    return float(np.sqrt((miss**2).mean()) / bell.peak) if reach.any() else None


def _to_demonstrator(run: RunRecord) -> Numbers:
    """
    Compare with the demonstrator, from the start of the reach to the end of the exchange.

    None if the demonstrator rests meanwhile, as where the robot picked the object up later.
    """
    unknown: Numbers = dict.fromkeys(('rms_m', 'largest_m', 'at_exchange_m'))
    begin, end = run.handover_span_s
    if len(run.demonstrator_times) < 2:
        return unknown
    begin = max(begin, run.demonstrator_times[0], run.wrist_times[0])
    end = min(end, run.demonstrator_times[-1], run.wrist_times[-1])
    times = np.arange(begin, end, 1 / RATE_HZ)
    even, velocities = velocity(run.demonstrator_times, run.demonstrator_positions)
    speeds = np.linalg.norm(velocities[(even >= begin) & (even <= end)], axis=1)
    if len(times) == 0 or speeds.max(initial=0.0) < ACTIVE_SPEED:
        return unknown

    def distance(at: Array) -> Array:
        wrist = resample(run.wrist_times, run.wrist_positions, at)
        demonstrator = resample(run.demonstrator_times, run.demonstrator_positions, at)
        apart: Array = np.linalg.norm(wrist - demonstrator, axis=1)
        return apart

    apart, met = distance(times), run.exchange_time_s
    return {
        'rms_m': float(np.sqrt((apart**2).mean())),
        'largest_m': float(apart.max()),
        'at_exchange_m': None if met is None else float(distance(np.array([met]))[0]),
    }


def tracker_errors(run: RunRecord) -> dict[str, Numbers]:
    """
    Compare each tracker, and the fused estimate, with the true hand.

    Args:
        run: the run.

    Returns:
        By name of the tracker, or `fused`: `poses`, `rate_hz`, the RMS error `rms_m`, its constant
        part `bias_m` and the standard deviation of the rest, `noise_m`; empty if the true hand
        was not recorded, or if all trackers saw exactly the truth.

    """
    if run.hand_topic != HAND_TRUTH.name:
        return {}
    found: dict[str, Numbers] = {}
    for name, (times, positions) in seen_hands(run).items():
        known = (times >= run.hand_times[0]) & (times <= run.hand_times[-1])
        if known.sum() < 2:
            continue
        times, positions = times[known], positions[known]
        off = positions - resample(run.hand_times, run.hand_positions, times)
        bias = off.mean(axis=0)
        found[name] = {
            'poses': len(times),
            'rate_hz': float((len(times) - 1) / (times[-1] - times[0])),
            'rms_m': float(np.sqrt(np.square(off).sum(axis=1).mean())),
            'bias_m': float(np.linalg.norm(bias)),
            'noise_m': float(np.sqrt(np.square(off - bias).sum(axis=1).mean())),
        }
    perfect = all(seen['rms_m'] < PERFECT_M for name, seen in found.items() if name != FUSED)
    return {} if perfect else found


def seen_hands(run: RunRecord) -> dict[str, tuple[Array, Array]]:
    """
    List the measurements of the hand.

    Args:
        run: the run.

    Returns:
        By name of the tracker: times (k,) s and positions (k, 3) m; last `fused`, the estimate
        of `dmp`.

    """
    return {**run.trackers, FUSED: (run.fused_times, run.fused_positions)}


def _hand_age(run: RunRecord) -> Numbers:
    """Age of the hand pose when it was used, from the start of the reach on."""
    age = run.phase.get('hand_age_s', np.zeros(0))
    used = np.isfinite(age) & (run.phase_times >= (run.reaching_time_s or 0.0))
    if not used.any():
        return {'hand_age_median_ms': None, 'hand_age_99_ms': None}
    middle, tail = np.percentile(age[used], (50, 99)) * 1e3
    return {'hand_age_median_ms': float(middle), 'hand_age_99_ms': float(tail)}


def _inverse_kinematics(run: RunRecord) -> Numbers:
    """How well the arm could follow during reach and exchange."""
    begin, end = run.handover_span_s
    used = (run.ik_times >= begin) & (run.ik_times <= end)
    found: Numbers = dict.fromkeys(('least_speed_share', 'limited_time_share'))
    found |= dict.fromkeys(('largest_position_residual_m_s', 'smallest_singular_value_m'))
    if used.any() and {'speed_scale', 'active_limits'} <= set(run.ik):
        found['least_speed_share'] = float(run.ik['speed_scale'][used].min())
        found['limited_time_share'] = float((run.ik['active_limits'][used] > 0).mean())
    if used.any() and {'position_residual', 'smallest_singular_value'} <= set(run.ik):
        found['largest_position_residual_m_s'] = float(run.ik['position_residual'][used].max())
        # unknown while the joints are unknown
        singular_values = run.ik['smallest_singular_value'][used]
        known = singular_values[np.isfinite(singular_values)]
        found['smallest_singular_value_m'] = float(known.min()) if known.size else None
    return found
