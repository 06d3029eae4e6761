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

"""The figure of a calibration: both paths in one frame, residuals, and search for the lag."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import UsageError
from handover_dmp.common.files import replacing
from handover_dmp.common.plot_style import PLOT_STYLE
from handover_dmp.tracking.calibration import Calibration
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from scipy.spatial.transform import Rotation

EXPECTED, SEEN, LEFT_OUT = '#1f4e9c', '#e0a526', '#d62728'
NAMES = 'XYZ'


def draw_calibration(found: Calibration, path: str | Path) -> None:
    """
    Draw a calibration.

    Args:
        found: the calibration.
        path: figure to write; its suffix selects the format.

    Raises:
        UsageError: matplotlib does not support this suffix.

    """
    path = Path(path)
    with rc_context(PLOT_STYLE):
        figure = Figure(figsize=(11.0, 7.6))
        if path.suffix.lstrip('.').lower() not in figure.canvas.get_supported_filetypes():
            raise UsageError(f'{path}: unknown picture format; use e.g. .png or .svg')
        edges = {'bottom': 0.075, 'top': 0.94}
        left = figure.add_gridspec(4, 1, left=0.075, right=0.6, hspace=0.3, **edges)
        right = figure.add_gridspec(2, 1, left=0.68, right=0.985, hspace=0.3, **edges)
        rows = [figure.add_subplot(left[row]) for row in range(4)]
        for axis, axes in enumerate(rows[:3]):
            axes.sharex(rows[3])
            axes.tick_params(labelbottom=False)
            _draw_axis(found, axis, axes)
        rows[0].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=9)
        _draw_residual(found, rows[3])
        _draw_lags(found, figure.add_subplot(right[0]))
        _draw_plan(found, figure.add_subplot(right[1]))
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=110)


def _draw_axis(found: Calibration, axis: int, axes: Axes) -> None:
    counted = found.counted
    start = found.times[0]
    times = found.times - start
    axes.plot(times[counted], found.seen[counted, axis], '.', color=SEEN, ms=4, label='tracker')
    axes.plot(times, found.expected[:, axis], color=EXPECTED, lw=1.0, label='reference')
    # outliers are marked at the edge, so that they do not shrink the rest
    low, high = found.expected[:, axis].min(), found.expected[:, axis].max()
    room = 0.25 * (high - low) + 0.01
    axes.plot(
        times[~counted],
        np.clip(found.seen[~counted, axis], low - room, high + room),
        'x', color=LEFT_OUT, ms=4, label='left out', clip_on=False,
    )  # fmt: skip
    axes.set_ylim(low - 1.1 * room, high + 1.1 * room)
    axes.set_ylabel(f'{NAMES[axis]} / m')


def _draw_residual(found: Calibration, axes: Axes) -> None:
    counted = found.counted
    times = found.times - found.times[0]
    distances = 1e3 * np.linalg.norm(found.expected - found.seen, axis=1)
    axes.plot(times[counted], distances[counted], '.', color='#59626d', ms=2.2)
    axes.axhline(1e3 * found.residual_m, color=EXPECTED, lw=1.0)
    axes.set_ylim(0.0, 1.15 * float(distances[counted].max()))
    axes.set_xlim(0.0, float(times[-1]))
    axes.set(xlabel='time / s', ylabel='apart / mm')
    axes.set_title(
        f'residual {1e3 * found.residual_m:.2g} mm (root mean square), '
        f'{int((~counted).sum())} of {len(counted)} poses left out'
    )


def _draw_lags(found: Calibration, axes: Axes) -> None:
    search = found.search
    finite = np.isfinite(search.errors)
    axes.plot(1e3 * search.lags[finite], 1e3 * search.errors[finite], color='#59626d', lw=1.4)
    axes.axvline(1e3 * found.delay_s, color=EXPECTED, lw=1.2)
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel='lag / ms', ylabel='misfit / mm')
    axes.set_title(
        f'delay {1e3 * found.delay_s:.1f} ± {1e3 * found.delay_interval_s:.1f} ms', pad=8
    )


def _draw_plan(found: Calibration, axes: Axes) -> None:
    counted = found.counted
    axes.plot(found.seen[counted, 0], found.seen[counted, 1], '.', color=SEEN, ms=3)
    axes.plot(found.expected[:, 0], found.expected[:, 1], color=EXPECTED, lw=0.8)
    place, turn = found.position, Rotation.from_quat(found.quaternion).as_matrix()
    size = 0.12 * max(float(np.ptp(found.expected[:, :2])), float(np.abs(place[:2]).max()), 0.5)
    for axis, colour in enumerate(('#d62728', '#2ca02c', '#1f77b4')):
        tip = place + size * turn[:, axis]
        axes.plot([place[0], tip[0]], [place[1], tip[1]], color=colour, lw=2.0)
    axes.plot(*place[:2], 'o', color='black', ms=5)
    axes.annotate(
        "tracker's frame", (place[0], place[1]), xytext=(0, -14), textcoords='offset points',
        fontsize=9, ha='center', va='top',
    )  # fmt: skip
    axes.set_aspect('equal', adjustable='datalim')
    axes.margins(0.15)
    axes.set(xlabel='X / m', ylabel='Y / m', title='from above')
