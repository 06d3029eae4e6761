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

"""
The figure of a session, like Fig. 3: X, Y and Z of both wrists, give and take shaded.

All three panels have the same scale.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Array
from handover_dmp.common.plot_style import EXCHANGE_TINTS, PLOT_STYLE
from handover_dmp.mocap.segmentation import Segment
from handover_dmp.mocap.session import RecordedSession
from handover_dmp.mocap.wrists import WristMotion
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

AXES = 'XYZ'
PARTNER_LINE: Mapping[str, Any] = {'color': '#c8372d', 'linewidth': 1.8}
DEMONSTRATOR_LINE: Mapping[str, Any] = {
    'color': '#2f9e5b',
    'linewidth': 1.8,
    'linestyle': (0, (5, 2)),
}
MIN_SPAN_M = 0.4
"""Least range of a panel; with less, its tick labels would overlap."""
MARGIN = 0.08
"""Margin above and below the curves of a panel, as a share of their range."""
_HEIGHT_IN = 6.4
_WIDTH_IN = (9.0, 0.5, 60.0)


class WristCurve(NamedTuple):
    """
    A wrist in the figure.

    Attributes:
        name: name in the legend.
        times: (n,) s.
        positions: (n, 3) m; NaN if the wrist was not seen.
        style: line style.

    """

    name: str
    times: Array
    positions: Array
    style: Mapping[str, Any]


def draw_session(session: RecordedSession) -> Figure:
    """
    Draw a recorded session.

    Args:
        session: both wrists, and the times of the exchanges.

    Returns:
        The figure.

    """
    motion = session.motion
    return draw_wrists(motion_curves(motion), session.exchanges, motion.source)


def motion_curves(motion: WristMotion) -> list[WristCurve]:
    """
    Make the curves of both wrists of a recording, interrupted in gaps.

    Args:
        motion: the recording.

    Returns:
        The curves of P1 and P2.

    """
    ends = [end for _, end in motion.spans()[:-1]]
    times = np.insert(motion.times, ends, motion.times[ends])
    people = (
        ('mechanic (P1)', motion.partner, PARTNER_LINE),
        ('assistant (P2)', motion.demonstrator, DEMONSTRATOR_LINE),
    )
    return [
        WristCurve(name, times, np.insert(positions, ends, np.nan, axis=0), style)
        for name, positions, style in people
    ]


def draw_wrists(curves: Sequence[WristCurve], exchanges: Sequence[Segment], title: str) -> Figure:
    """
    Draw X, Y and Z of wrists over time, with shaded exchanges.

    Args:
        curves: the wrists.
        exchanges: the exchanges to shade.
        title: title of the figure.

    Returns:
        The figure.

    """
    with rc_context(PLOT_STYLE):
        begin_s = min(float(curve.times[0]) for curve in curves)
        end_s = max(float(curve.times[-1]) for curve in curves)
        size = session_width(end_s - begin_s), _HEIGHT_IN
        figure = Figure(figsize=size, layout='constrained')
        panels = figure.subplots(3, 1, sharex=True, height_ratios=panel_heights(curves))
        wrist_panels(panels, curves, exchanges)
        figure.align_ylabels()
        panels[-1].set(xlabel='time / s', xlim=(begin_s, end_s))
        figure.suptitle(title, x=0.01, ha='left', fontsize=11)
    return figure


def session_width(duration_s: float) -> float:
    """
    Compute the width of a figure over time.

    Args:
        duration_s: shown time, s.

    Returns:
        The width, inch.

    """
    minimum, inches_a_second, maximum = _WIDTH_IN
    return min(max(minimum, inches_a_second * duration_s), maximum)


def wrist_panels(
    panels: Sequence[Axes], curves: Sequence[WristCurve], exchanges: Sequence[Segment]
) -> None:
    """
    Draw into three panels with heights from `panel_heights`; the legend is above them.

    Args:
        panels: axes for X, Y and Z.
        curves: the wrists.
        exchanges: the exchanges to shade.

    """
    for axis, panel in enumerate(panels):
        for curve in curves:
            panel.plot(curve.times, curve.positions[:, axis], label=curve.name, **curve.style)
        panel.set(ylabel=f'{AXES[axis]} / m', ylim=_range_of(curves, axis))
        shade_exchanges(panel, exchanges, named=axis == 0)
    # above the names of the exchanges
    panels[0].legend(
        loc='lower right', bbox_to_anchor=(1.02, 1.0), borderaxespad=1.8, ncols=len(curves)
    )


def panel_heights(curves: Sequence[WristCurve]) -> list[float]:
    """
    Compute the heights of the panels of X, Y and Z for a common scale.

    Args:
        curves: the wrists.

    Returns:
        The range of each panel, m.

    """
    ranges = [_range_of(curves, axis) for axis in range(3)]
    return [high - low for low, high in ranges]


def shade_exchanges(axes: Axes, exchanges: Sequence[Segment], *, named: bool) -> None:
    """
    Shade the exchanges from the reach to the parting, with a line when the hands have met.

    Args:
        axes: axes over time.
        exchanges: the exchanges.
        named: whether to write `give` and `take` above.

    """
    for part in exchanges:
        end_s = part.parting_s or part.exchange_s
        axes.axvspan(part.start_s, end_s, color=EXCHANGE_TINTS[part.direction], lw=0, zorder=0.5)
        axes.axvline(part.exchange_s, color='#39424d', lw=0.9, ls=(0, (2, 2)), zorder=1.5)
        if named:
            axes.annotate(
                part.direction,
                (0.5 * (part.start_s + end_s), 1.0),
                xycoords=axes.get_xaxis_transform(),
                xytext=(0, 4),
                textcoords='offset points',
                ha='center',
            )


def _range_of(curves: Sequence[WristCurve], axis: int) -> tuple[float, float]:
    values = np.concatenate([curve.positions[:, axis] for curve in curves])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    span = max((1.0 + 2.0 * MARGIN) * (high - low), MIN_SPAN_M)
    middle = 0.5 * (low + high)
    return middle - 0.5 * span, middle + 0.5 * span
