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

"""The picture of a segmented recording."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import UsageError
from handover_dmp.common.files import replacing
from handover_dmp.mocap.filtering import smooth
from handover_dmp.mocap.segmentation import SegmentedMotion
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

_TINTS = {'give': '#9ecae1', 'take': '#fdd0a2'}
_PARTNERS = (('P1', '#d62728'), ('P2', '#2ca02c'))
_WIDTH_IN = (9.0, 0.5, 60.0)


def draw_segmentation(segmented: SegmentedMotion, path: str | Path) -> None:
    """
    Draw distance and speeds of the wrists, the thresholds, and the handovers found.

    Args:
        segmented: the recording and what was found in it.
        path: picture to write; its suffix tells the kind.

    Raises:
        UsageError: matplotlib knows no picture of this suffix.

    """
    path = Path(path)
    motion, thresholds = segmented.motion, segmented.thresholds
    minimum, inches_a_second, maximum = _WIDTH_IN
    duration = float(motion.times[-1] - motion.times[0])
    width = min(max(minimum, inches_a_second * duration), maximum)
    figure = Figure(figsize=(width, 5.6), layout='constrained')
    if path.suffix.lstrip('.').lower() not in figure.canvas.get_supported_filetypes():
        raise UsageError(f'{path}: no kind of picture by its suffix; .png or .svg will do')
    top, bottom = figure.subplots(2, 1, sharex=True)
    for first, end in motion.spans():
        if end - first < 4:
            continue
        both = np.hstack([motion.partner[first:end], motion.demonstrator[first:end]])
        times, positions, velocities = smooth(motion.times[first:end], both)
        distance = np.linalg.norm(positions[:, 3:] - positions[:, :3], axis=1)
        top.plot(times, distance, color='black', lw=1.4)
        for k, (name, colour) in enumerate(_PARTNERS):
            speed = np.linalg.norm(velocities[:, 3 * k: 3 * k + 3], axis=1)  # fmt: skip
            bottom.plot(times, speed, color=colour, lw=1.2, label=name if first == 0 else None)
    _mark_handovers(segmented, top, bottom)
    _line(top, thresholds.near_m, 'near')
    _line(top, thresholds.apart_m, 'apart')
    _line(bottom, thresholds.moving_speed, 'moves')
    _line(bottom, thresholds.reach_speed, 'reaches')
    top.set_ylabel('wrist to wrist / m')
    bottom.set_ylabel('speed of wrist / m/s')
    bottom.set_xlabel('time / s')
    bottom.set_xlim(float(motion.times[0]), float(motion.times[-1]))
    for axes in (top, bottom):
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.25)
        axes.spines[['top', 'right']].set_visible(False)
    gives = sum(found.direction == 'give' for found in segmented.segments)
    takes = len(segmented.segments) - gives
    left_out = len(segmented.passages)
    top.set_title(
        f'{motion.source}: {_count(gives, "give")}, {_count(takes, "take")}, {left_out} left out',
        fontsize=11,
    )
    bottom.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=9)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)


def _mark_handovers(segmented: SegmentedMotion, top: Axes, bottom: Axes) -> None:
    for start_s, exchange_s, direction, *_ in segmented.segments:
        for axes in (top, bottom):
            axes.axvspan(start_s, exchange_s, color=_TINTS[direction], alpha=0.7, lw=0)
            axes.axvline(exchange_s, color='black', lw=0.8)
        middle = 0.5 * (start_s + exchange_s)
        top.text(
            middle, 0.04, direction, transform=top.get_xaxis_transform(), ha='center', fontsize=9
        )
    for at_s, reason in segmented.passages:
        top.axvline(at_s, color='gray', lw=1.0, ls=':')
        top.text(
            at_s, 0.97, reason, transform=top.get_xaxis_transform(), fontsize=8, color='gray',
            rotation=90, va='top', ha='right',
        )  # fmt: skip


def _line(axes: Axes, level: float, name: str) -> None:
    axes.axhline(level, color='gray', lw=0.8, ls='--')
    axes.annotate(
        name, (1.0, level), xycoords=('axes fraction', 'data'), xytext=(3, 0),
        textcoords='offset points', va='center', fontsize=8, color='gray', annotation_clip=False,
    )  # fmt: skip


def _count(number: int, noun: str) -> str:
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'
