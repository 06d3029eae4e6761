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

"""The figures of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.files import replacing
from handover_dmp.common.plot_style import EXCHANGE_COLOUR, PLOT_STYLE
from handover_dmp.mocap.segmentation import Segment
from handover_dmp.mocap.session_figure import draw_wrists, WristCurve
from handover_dmp.mocap.trial import DIRECTIONS
from handover_dmp.report.legs import legs_of
from handover_dmp.report.metrics import FEEDBACK_WEIGHT, FUSED, goal_at, seen_hands, tracker_errors
from handover_dmp.report.motion import bell_of, resample, velocity
from handover_dmp.report.recorded_run import RunRecord
from handover_dmp.report.session import is_session
from handover_dmp.topics import (
    HAND_POSE,
    JOINT_STATES,
    POSE_COMMAND,
    WRIST_POSE,
)
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FormatStrFormatter, MaxNLocator, NullLocator
import numpy as np

Style = dict[str, Any]

# The paper's colours, in different lightness and with different line styles, so that readers
# who cannot tell red from green can read the figures.
HAND: Style = {'color': '#c8372d', 'linewidth': 1.8, 'linestyle': '-', 'zorder': 2.2}
ROBOT: Style = {'color': '#1f4e9c', 'linewidth': 2.2, 'linestyle': '-', 'zorder': 2.3}
DEMONSTRATOR: Style = {
    'color': '#4caf72',
    'linewidth': 1.8,
    'linestyle': (0, (5, 2)),
    'zorder': 2.1,
}
COMMAND: Style = {'color': '#111111', 'linewidth': 1.0, 'linestyle': (0, (1, 1.5)), 'zorder': 2.4}
LIMIT: Style = {'color': '#8a1c7c', 'linewidth': 1.0, 'linestyle': (0, (6, 2, 1, 2))}
QUIET: Style = {'color': '#59626d', 'linewidth': 1.5, 'linestyle': '-'}
HAND_NAME, ROBOT_NAME, DEMONSTRATOR_NAME = (
    "partner's hand (P1)",
    'robot wrist',
    'demonstrator (P2)',
)

# Markers of the trackers; each has its own shape and colour.
SEEN: tuple[Style, ...] = (
    {'color': '#8a5a00', 'linestyle': '', 'marker': '.', 'markersize': 3.0, 'zorder': 2.0},
    {'color': '#1f4e9c', 'linestyle': '', 'marker': 'x', 'markersize': 4.5, 'zorder': 2.15},
    {'color': '#59626d', 'linestyle': '', 'marker': '+', 'markersize': 5.0, 'zorder': 2.1},
)

SMALL_MM = 0.1
DPI = 120
WIDTH = 9.0
# time shown before the arm begins to move
BEFORE_S = 0.3

CAPTIONS = {
    'session': "The whole session: X, Y and Z of the partner's hand (red), the robot's wrist "
    "(blue), and the demonstrator's wrist (green, dashed). Give and take are shaded from the "
    'start of the reach until the hands part; the dotted line is the start of the exchange.',
    'positions': "Position over time: the partner's hand (red), the robot's wrist (blue), and the "
    "demonstrator's wrist (green, dashed). The exchange is shaded.",
    'trackers': 'The hand: measurements of each tracker (markers, at the time of measurement), '
    'true position (red) and fused estimate (black). Above: the axis with the largest motion; '
    'below: distance from the true position.',
    'paths': 'The same paths in space, from above and from the side.',
    'speeds': "Speeds. The thin line is the minimum-jerk profile fitted to the robot's reach.",
    'phase': 'The movement primitive: its phase s, and the goal weight, which blends from the '
    'learnt shape to following the hand.',
    'joints': 'Joint positions and velocities, with their limits.',
    'inverse_kinematics': 'Inverse kinematics: speed scale (share of the commanded speed that the '
    'limits allowed), number of active limits, residuals, and distance from singularity.',
    'timing': 'Timing: time between messages by their stamps, and age of the hand pose when it '
    'was used.',
}


def write_figures(run: RunRecord, folder: Path) -> list[str]:
    """
    Draw every figure that the run has data for.

    Args:
        run: the run.
        folder: folder for the PNG files; created if missing.

    Returns:
        The names of the figures, without suffix, in the order of a report.

    """
    drawings: dict[str, Callable[[RunRecord], Figure | None]] = {
        'session': draw_session_of_run,
        'positions': draw_positions,
        'trackers': draw_trackers,
        'paths': draw_paths,
        'speeds': draw_speeds,
        'phase': draw_phase,
        'joints': draw_joints,
        'inverse_kinematics': draw_inverse_kinematics,
        'timing': draw_timing,
    }
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    with rc_context(PLOT_STYLE):
        for name, draw in drawings.items():
            figure = draw(run)
            if figure is not None:
                with replacing(folder / f'{name}.png') as temporary:
                    figure.savefig(temporary, dpi=DPI)
                drawn.append(name)
    return drawn


def draw_session_of_run(run: RunRecord) -> Figure | None:
    """Draw X, Y and Z over a whole session, like Fig. 3; None for a single handover."""
    exchanges = exchanges_of(run)
    if len(exchanges) < 2:
        return None
    curves = [
        WristCurve(name, times, positions, style) for times, positions, style, name in _tracks(run)
    ]
    return draw_wrists(curves, exchanges, '')


def exchanges_of(run: RunRecord) -> list[Segment]:
    """
    Find the exchanges of a session.

    Args:
        run: the session.

    Returns:
        The exchanges that took place, give and take in turn.

    """
    found: list[Segment] = []
    reach_s: float | None = None
    met_s: float | None = None
    for time_s, state in run.states:
        if state == 'exchange':
            met_s = time_s
        elif met_s is not None and reach_s is not None:
            direction = DIRECTIONS[len(found) % len(DIRECTIONS)]
            found.append(Segment(reach_s, met_s, direction, time_s))
            reach_s = met_s = None
        if state == 'reaching':
            reach_s = time_s
    return found


def draw_positions(run: RunRecord) -> Figure:
    """Draw X, Y and Z over time, like Fig. 4 of the paper."""
    with _panels(3, 2.0, run) as (figure, axes):
        for axis, ax in enumerate(axes):
            for times, positions, style, name in _tracks(run):
                ax.plot(times, positions[:, axis], **style, label=name)
            ax.set_ylabel(f'{"XYZ"[axis]}, m')
    return figure


def draw_trackers(run: RunRecord) -> Figure | None:
    """Draw the measurements of each tracker and the true hand, unless they are identical."""
    if not tracker_errors(run):
        return None
    axis = int(np.argmax(np.ptp(run.hand_positions, axis=0)))
    with _panels(2, 2.6, run) as (figure, (place, apart)):
        place.plot(run.hand_times, run.hand_positions[:, axis], **HAND, label=HAND_NAME)
        for number, (name, (times, positions)) in enumerate(seen_hands(run).items()):
            if not len(times):
                continue
            fused = name == FUSED
            style = COMMAND | {'linestyle': '-'} if fused else SEEN[number % len(SEEN)]
            off = positions - resample(run.hand_times, run.hand_positions, times)
            label = 'fused' if fused else name.replace('_', ' ')
            place.plot(times, positions[:, axis], **style, label=label)
            apart.plot(times, np.linalg.norm(off, axis=1) * 1e3, **style)
        place.set_ylabel(f'{"XYZ"[axis]}, m')
        # logarithmic, so that outliers are visible and do not hide the rest
        apart.set(ylabel='distance from the hand, mm', yscale='log')
        apart.set_ylim(bottom=SMALL_MM)
        apart.yaxis.set_major_formatter(FormatStrFormatter('%g'))
    return figure


def draw_paths(run: RunRecord) -> Figure:
    """Draw the paths in space, from above and from the side."""
    figure = Figure(figsize=(WIDTH, 4.2))
    grid = figure.add_gridspec(1, 3, width_ratios=(1.35, 1, 1))
    _margins(figure, left=0.0, right=0.15, top=0.35, bottom=0.95, wspace=0.3)
    space: Any = figure.add_subplot(grid[0], projection='3d')
    above, side = figure.add_subplot(grid[1]), figure.add_subplot(grid[2])
    shown = _shown_span(run)
    met = run.exchange_time_s
    corners = []
    for times, positions, style, name in _tracks(run):
        chosen = (times >= shown[0]) & (times <= shown[1])
        if not chosen.any():
            continue
        corners += [positions[chosen].min(axis=0), positions[chosen].max(axis=0)]
        x, y, z = positions[chosen].T
        mark = {'color': style['color'], 'zorder': style['zorder'] + 1}
        space.plot(x, y, z, **style, label=name)
        above.plot(x, y, **style)
        side.plot(x, z, **style)
        for ax, ends in ((above, (x, y)), (side, (x, z))):
            ax.plot(ends[0][0], ends[1][0], 'o', markersize=5, **mark)
        if met is not None:
            place = [float(np.interp(met, times, column)) for column in positions.T]
            space.plot(*[[one] for one in place], '*', markersize=11, **mark)
            for ax, pair in ((above, (0, 1)), (side, (0, 2))):
                ax.plot(place[pair[0]], place[pair[1]], '*', markersize=11, **mark)
    for ax, vertical, title in ((above, 'Y', 'from above'), (side, 'Z', 'from the side')):
        ax.set(xlabel='X, m', ylabel=f'{vertical}, m', title=title)
        ax.margins(0.08)
        ax.set_aspect('equal', adjustable='datalim')
        for scale in (ax.xaxis, ax.yaxis):
            scale.set_major_locator(MaxNLocator(4))
    space.set(xlabel='X, m', ylabel='Y, m', zlabel='Z, m')
    space.yaxis.labelpad = 12.0  # clear of the numbers
    space.view_init(elev=25, azim=-70)
    middle = (np.max(corners, axis=0) + np.min(corners, axis=0)) / 2
    half = float(np.ptp(corners, axis=0).max()) / 2 * 1.05
    space.set(
        **{
            f'{axis}lim': (place - half, place + half)
            for axis, place in zip('xyz', middle, strict=True)
        }
    )
    space.set_box_aspect((1, 1, 1), zoom=0.88)
    for scale in (space.xaxis, space.yaxis, space.zaxis):
        scale.set_major_locator(MaxNLocator(4))
        scale.set_tick_params(labelsize=8)
    space.set_title('● start   ★ exchange' if met is not None else '● start')
    figure.legend(*space.get_legend_handles_labels(), loc='lower center', ncols=3)
    return figure


def draw_speeds(run: RunRecord) -> Figure:
    """Draw the speeds and the minimum-jerk profile."""
    with _panels(1, 3.6, run) as (figure, axes):
        (ax,) = axes
        for times, positions, style, name in _tracks(run):
            even, velocities = velocity(times, positions)
            if len(even):
                ax.plot(even, np.linalg.norm(velocities, axis=1), **style, label=name)
        even, velocities = velocity(run.wrist_times, run.wrist_positions)
        bell = bell_of(even, np.linalg.norm(velocities, axis=1), run.exchange_time_s)
        if bell is not None:
            shown = even[(even >= bell.begin_s) & (even <= bell.begin_s + bell.duration_s)]
            ax.plot(shown, bell.speed(shown), **{**QUIET, 'linewidth': 1.0}, label='minimum jerk')
        ax.set_ylabel('speed, m/s')
        ax.set_ylim(bottom=0)
    return figure


def draw_phase(run: RunRecord) -> Figure | None:
    """Draw phase, goal weight and the distance to the goal."""
    if not {'phase', 'goal_weight'} <= set(run.phase):
        return None
    with _panels(2, 2.3, run) as (figure, (ax, gap)):
        weight = run.phase['goal_weight']
        ax.plot(run.phase_times, run.phase['phase'], **{**QUIET, 'linestyle': (0, (5, 2))},
                label='phase s')  # fmt: skip
        ax.plot(run.phase_times, weight, **ROBOT, label='goal weight $w_g$')
        ax.set(ylim=(-0.04, 1.04), ylabel='share')
        goal = goal_at(run, run.wrist_times)
        distance = np.linalg.norm(goal - run.wrist_positions, axis=1) * 1e3
        gap.plot(run.wrist_times, distance, **QUIET)
        gap.set(ylabel='wrist to goal, mm', yscale='log')
        following = np.flatnonzero(weight >= FEEDBACK_WEIGHT)
        if len(following):
            begin = run.phase_times[following[0]]
            gap.axvline(begin, color='#59626d', linewidth=0.8, linestyle=':')
            gap.annotate(' follows the hand', (begin, 0.94), xycoords=('data', 'axes fraction'),
                         fontsize=9, va='top', color='#39424d')  # fmt: skip
    return figure


def draw_joints(run: RunRecord) -> Figure:
    """Draw positions and velocities of all joints with their limits."""
    count = len(run.joint_names)
    limits = run.joint_limits
    with _panels(count, 1.15, run, columns=2) as (figure, axes):
        for index, name in enumerate(run.joint_names):
            position, speed = axes[2 * index], axes[2 * index + 1]
            position.plot(run.joint_times, np.degrees(run.joint_positions[:, index]), **ROBOT)
            speed.plot(run.joint_times, np.degrees(run.joint_velocities[:, index]), **ROBOT)
            if len(run.joint_commands):
                commands = np.degrees(run.joint_commands[:, index])
                speed.plot(run.joint_command_times, commands, **COMMAND)
            if limits is not None:
                for bound, turn in ((limits.lower[index], -180.0), (limits.upper[index], 180.0)):
                    if np.isfinite(bound):
                        position.axhline(np.degrees(bound), **LIMIT)
                    else:
                        # half a turn, or noise would fill the panel of a joint at rest
                        position.update_datalim([(run.joint_times[0], turn)])
                for sign in (-1, 1):
                    speed.axhline(sign * np.degrees(limits.velocity[index]), **LIMIT)
            position.set_ylabel(name.replace('_', ' '), fontsize=9)
            for ax in (position, speed):
                ax.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
        axes[0].set_title('position, °')
        axes[1].set_title('velocity, °/s')
        axes[0].plot([], [], **ROBOT, label='measured')
        if len(run.joint_commands):
            axes[0].plot([], [], **COMMAND, label='commanded')
        if limits is not None:
            axes[0].plot([], [], **LIMIT, label='limit')
    return figure


def draw_inverse_kinematics(run: RunRecord) -> Figure | None:
    """Draw the status of the inverse kinematics."""
    panels = [
        ('speed_scale', 'speed scale', 1.0, (-0.04, 1.06), 0.0),
        ('active_limits', 'active limits', 1.0, None, 1.0),
        ('position_residual', 'position\nresidual, mm/s', 1e3, None, 1.0),
        ('orientation_residual', 'orientation\nresidual, mrad/s', 1e3, None, 1.0),
        ('smallest_singular_value', 'smallest singular\nvalue, m', 1.0, None, 0.1),
    ]
    panels = [panel for panel in panels if panel[0] in run.ik]
    if not panels:
        return None
    with _panels(len(panels), 1.35, run) as (figure, axes):
        for ax, (key, label, factor, span, minimum) in zip(axes, panels, strict=True):
            step: Style = {'drawstyle': 'steps-post'} if key == 'active_limits' else {}
            ax.plot(run.ik_times, run.ik[key] * factor, **QUIET, **step)
            ax.set_ylabel(label)
            if span:
                ax.set_ylim(span)
            else:
                ax.set_ylim(
                    0.0, 1.08 * max(minimum, float(np.nanmax(run.ik[key], initial=0.0)) * factor)
                )
                ax.yaxis.set_major_locator(MaxNLocator(3, integer=key == 'active_limits'))
    return figure


def draw_timing(run: RunRecord) -> Figure:
    """Draw histograms of the periods and of the age of the hand pose."""
    topics = [
        topic.name
        for topic in (HAND_POSE, JOINT_STATES, WRIST_POSE, POSE_COMMAND)
        if len(run.stamps.get(topic.name, ())) > 2
    ]
    age = run.phase.get('hand_age_s')
    figure = Figure(figsize=(WIDTH, 4.8))
    axes = figure.subplots(2, 3).ravel()
    _margins(figure, left=0.6, right=0.15, top=0.5, bottom=0.5, hspace=0.62, wspace=0.3)
    for ax, topic in zip(axes, topics, strict=False):
        # in lockstep a message is repeated until it is answered; count each stamp once
        periods = np.diff(np.unique(run.stamps[topic])) * 1e3
        _histogram(ax, periods, topic, 'time between messages, ms')
    rest = axes[len(topics):]  # fmt: skip
    if age is not None and np.isfinite(age).any():
        begin, end = _shown_span(run)
        used = (run.phase_times >= begin) & (run.phase_times <= end) & np.isfinite(age)
        if used.any():
            _histogram(rest[0], age[used] * 1e3, 'age of the hand', 'age, ms')
            rest = rest[1:]
    for ax in rest:
        ax.set_axis_off()
    return figure


def _histogram(ax: Axes, values_ms: Array, title: str, label: str) -> None:
    low, high = float(values_ms.min()), float(values_ms.max())
    room = max(0.25, 0.1 * (high - low))
    # an odd number of bins, so that a constant period is one bar and not two halves
    ax.hist(values_ms, bins=41, range=(max(0.0, low - room), high + room), color='#1f4e9c')
    ax.set(xlabel=label, ylabel='count', yscale='log')
    ax.set_ylim(bottom=0.7)
    # single outliers matter, too: the scale is logarithmic and the title has the tail
    ax.yaxis.set_minor_locator(NullLocator())
    middle, tail = np.percentile(values_ms, (50, 99))
    ax.set_title(f'{title}\nmedian {middle:.2f} ms, 99 % {tail:.2f} ms', fontsize=9.5)


@contextmanager
def _panels(
    rows: int, height: float, run: RunRecord, columns: int = 1
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Make stacked panels with a common time axis and a shaded exchange."""
    figure = Figure(figsize=(WIDTH, 1.0 + rows * height))
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    _margins(figure, left=0.85, right=0.15, top=0.4 if columns == 1 else 0.65, bottom=0.55)
    axes = list(grid.ravel())
    yield figure, axes
    spans = _exchange_spans(run)
    for ax in axes:
        ax.set_xlim(*_shown_span(run))
        for span in spans:
            ax.axvspan(*span, color=EXCHANGE_COLOUR, alpha=0.55, linewidth=0, zorder=0)
    for ax in grid[-1]:
        ax.set_xlabel('time, s')
    lines = axes[0].get_legend_handles_labels()[0]
    if spans:
        lines = [*lines, Patch(color=EXCHANGE_COLOUR, alpha=0.55, label='exchange')]
    figure.legend(
        handles=lines, loc='upper left', ncols=len(lines) or 1, borderaxespad=0.3,
        bbox_to_anchor=(0.85 / WIDTH - 0.01, 1.0), columnspacing=1.2, handlelength=1.8,
    )  # fmt: skip
    figure.align_ylabels(axes)


def _exchange_spans(run: RunRecord) -> list[tuple[float, float]]:
    """Return begin and end of each exchange, s."""
    of_one = [leg.run for leg in legs_of(run)] if is_session(run) else [run]
    return [one.exchange_span_s for one in of_one if one.exchange_span_s is not None]


def _margins(
    figure: Figure, *, left: float, right: float, top: float, bottom: float, **gaps: float
) -> None:
    """Set the margins in inches; matplotlib's own layouts take as long as all the drawing."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, top=1 - top / height, bottom=bottom / height,
        **{'hspace': 0.13, 'wspace': 0.2, **gaps},
    )  # fmt: skip


def _tracks(run: RunRecord) -> list[tuple[Array, Array, Style, str]]:
    """Return times, positions, line style and name of each recorded motion."""
    tracks = [
        (run.hand_times, run.hand_positions, HAND, HAND_NAME),
        (run.wrist_times, run.wrist_positions, ROBOT, ROBOT_NAME),
        (run.demonstrator_times, run.demonstrator_positions, DEMONSTRATOR, DEMONSTRATOR_NAME),
    ]
    return [track for track in tracks if len(track[0])]


def _shown_span(run: RunRecord) -> tuple[float, float]:
    begin = run.reaching_time_s
    return (max(0.0, begin - BEFORE_S) if begin is not None else 0.0, run.end_time_s)
