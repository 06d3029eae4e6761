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

"""The figure of a segmented recording."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.errors import UsageError
from handover_dmp.common.files import replacing
from handover_dmp.common.plot_style import PLOT_STYLE
from handover_dmp.mocap.segmentation import SegmentedMotion, SmoothedSection
from handover_dmp.mocap.session_figure import (
    DEMONSTRATOR_LINE,
    motion_curves,
    panel_heights,
    PARTNER_LINE,
    session_width,
    shade_exchanges,
    wrist_panels,
)
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

_COLOURS = (str(PARTNER_LINE['color']), str(DEMONSTRATOR_LINE['color']))
_HEIGHT_IN = 10.0
_WRISTS_SHARE = 2.2


def draw_segmentation(segmented: SegmentedMotion, path: str | Path) -> None:
    """
    Draw both wrists, their distance and speeds, the thresholds, and the handovers found.

    Args:
        segmented: the segmented recording.
        path: image file; its suffix sets the format.

    Raises:
        UsageError: matplotlib does not know the suffix.

    """
    path = Path(path)
    motion, thresholds = segmented.motion, segmented.thresholds
    with rc_context(PLOT_STYLE):
        width = session_width(float(motion.times[-1] - motion.times[0]))
        figure = Figure(figsize=(width, _HEIGHT_IN), layout='constrained')
        if path.suffix.lstrip('.').lower() not in figure.canvas.get_supported_filetypes():
            raise UsageError(f'{path}: unknown image format; use .png or .svg')
        curves = motion_curves(motion)
        heights = np.array(panel_heights(curves))
        every = figure.subplots(
            5, 1, sharex=True, height_ratios=[*(_WRISTS_SHARE * heights / heights.sum()), 1.0, 1.0]
        )
        wrist_panels(every[:3], curves, segmented.segments)
        distances, speeds = every[3:]
        for first, end in motion.spans():
            if end - first < 4:
                continue
            section = SmoothedSection.of(motion, first, end)
            distances.plot(section.times, section.distance, color='#111111', lw=1.4)
            for speed, colour in zip(section.speeds, _COLOURS, strict=True):
                speeds.plot(section.times, speed, color=colour, lw=1.2)
        for axes in (distances, speeds):
            shade_exchanges(axes, segmented.segments, named=False)
            axes.set_ylim(bottom=0.0)
        _mark_passages(segmented, distances)
        _line(distances, thresholds.near_m, 'near')
        _line(distances, thresholds.apart_m, 'apart')
        _line(speeds, thresholds.moving_speed, 'moves')
        _line(speeds, thresholds.reach_speed, 'reaches')
        distances.set_ylabel('wrist to wrist / m')
        speeds.set(xlabel='time / s', ylabel='speed of wrist / m/s')
        speeds.set_xlim(float(motion.times[0]), float(motion.times[-1]))
        figure.align_ylabels()
        gives = sum(found.direction == 'give' for found in segmented.segments)
        takes = len(segmented.segments) - gives
        figure.suptitle(
            f'{motion.source}: {_count(gives, "give")}, {_count(takes, "take")}, '
            f'{len(segmented.passages)} left out',
            x=0.01,
            ha='left',
            fontsize=11,
        )
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=110)


def _mark_passages(segmented: SegmentedMotion, axes: Axes) -> None:
    for at_s, reason in segmented.passages:
        axes.axvline(at_s, color='gray', lw=1.0, ls=':')
        axes.text(
            at_s, 0.97, reason, transform=axes.get_xaxis_transform(), fontsize=8, color='gray',
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
