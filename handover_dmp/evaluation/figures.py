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

"""The figures of the paper's Section III, as PNG and SVG."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.files import replacing
from handover_dmp.common.plot_style import EXCHANGE_COLOUR, PLOT_STYLE
from handover_dmp.evaluation.beside import Beside, PERSON
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.envelope import Envelope
from handover_dmp.evaluation.motions import ALONE, ARM
from handover_dmp.evaluation.rejections import Rejections
from handover_dmp.evaluation.scores import BANDS
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter
import numpy as np
from numpy.typing import NDArray

PARTNER_COLOUR, DEMONSTRATOR_COLOUR, DMP_COLOUR = '#c8372d', '#2f8f4e', '#1f5fb4'
MOVER_COLOURS = {ALONE: DMP_COLOUR, ARM: '#b9770e', PERSON: DEMONSTRATOR_COLOUR}
INSIDE_COLOUR, OUTSIDE_COLOUR = '#2f9e55', '#d64533'
BAND_COLOURS = {3: '#e1e6ec', 1: '#aab6c4'}
AXES = 'XYZ'
POSITION_LABELS = tuple(f'{axis}, m' for axis in AXES)
AXES_COLOURS = ('#c8372d', '#2f8f4e', '#1f5fb4')

MAX_TRIALS = 8
"""Largest number of trials drawn one after the other; more would be unreadable."""

MAX_CURVES = 60
"""Largest number of curves in a panel, evenly chosen; the percentages count all."""

NARROWEST = 8.5
"""Least width of a figure with title and legend side by side, inch."""

SWARM_ROWS, SWARM_STEP, SWARM_REACH = 36, 0.04, 0.32
"""Number of height classes of dots; sideways step between dots of one class, and its maximum."""

FEW_CURVES = 10
"""Up to this number, curves are drawn with broad lines."""

SCALE_SHARE = 10.0
"""Least range of an axis of shares, percent, so that small shares look small."""

SKEWED = ('path_ratio',)
"""Measures with a logarithmic scale."""

EXCHANGE_BAND_M = 0.03
"""The exchange is shaded while the wrists are within this of their least distance."""

STYLE: Any = {
    **PLOT_STYLE,
    'font.size': 9.5,
    'axes.titlesize': 10,
    'axes.titlelocation': 'center',
    'axes.labelsize': 9.5,
    'axes.xmargin': 0.05,
    'lines.solid_capstyle': 'round',
    'svg.hashsalt': 'handover_dmp',
}

NECK: Any = {'color': '#59626d', 'lw': 1.2, 'ls': (0, (4, 3))}
"""Line at the width of a bottleneck."""

LEARN_FIGURES = {
    'single': ('07-09', 'Figs 7–9'),
    'mean': ('10-12', 'Figs 10–12'),
    'representative': ('13', 'not in the paper'),
}
"""Number in the file name, and in the caption, by source of learning."""

_ROW_GAP = 0.26

_FORMATS: dict[str, dict[str, Any]] = {
    '.png': {'dpi': 150},
    '.svg': {'metadata': {'Date': None}},
}


@dataclass(frozen=True)
class Shown:
    """
    The rollouts of one case that a figure shows with the band.

    Attributes:
        curves: (k, 101, 3) m, time-normalised, k at most some hundreds.
        inside: (k, 3) whether each is within 3σ.
        share: (3,) share of all curves within 3σ, including those not shown.
        within: by k, percentage of all curves within kσ.
        rollouts: number of all rollouts.

    """

    curves: Array
    inside: NDArray[np.bool_]
    share: Array
    within: dict[int, float]
    rollouts: int


@dataclass(frozen=True)
class Panel:
    """
    The content of the figures of one case.

    Attributes:
        case: the trials.
        learnt: index of the trial that Figs 4 to 6 learn from.
        tested: index of the other trial that they test against; None: the one with the median
            distance.
        rollouts: rollouts of the model learnt from that trial, against every trial, (n, m, 3) m
            on the clock of `case.hands`.
        shown: the shown rollouts, by source of learning.
        rejections: curves that leave the band, for the first source of learning.

    """

    case: Case
    learnt: int
    tested: int | None
    rollouts: Array
    shown: dict[str, Shown]
    rejections: Rejections


def draw(panels: Sequence[Panel], folder: Path) -> Iterator[tuple[str, str]]:
    """
    Draw every figure, one configuration at a time.

    Args:
        panels: the cases; the cases of one configuration share figures.
        folder: folder for the files NAME.png and NAME.svg.

    Yields:
        Name and caption of each figure as soon as it is written.

    """
    by_configuration: dict[str, list[Panel]] = {}
    for panel in panels:
        by_configuration.setdefault(panel.case.configuration, []).append(panel)
    for configuration, group in by_configuration.items():
        title = configuration.replace('_', ' ')
        file = re.sub(r'[^A-Za-z0-9_-]+', '-', configuration).strip('-') or 'unnamed'
        for kind, make, caption in _figures(group[0].shown):
            name = f'{kind}_{file}'
            with rc_context(STYLE):
                _save(make(group, title), folder / name)
            yield name, f'{title}: {caption}'


def _figures(learns: Container[str]) -> Iterator[tuple[str, Callable[..., Figure], str]]:
    """Yield kind, maker and caption of the figures of a configuration."""
    yield 'fig03_traces', _traces, 'wrists of P1 and P2 in all trials, exchanges shaded (Fig. 3)'
    yield (
        'fig04-06_rollouts',
        _rollouts,
        'the DMP with the hand of its demonstration, and with another (Figs 4–6)',
    )
    for learn, (numbers, paper) in LEARN_FIGURES.items():
        if learn in learns:
            caption = f'learn {learn} and the spread of people ({paper})'
            yield f'fig{numbers}_learn_{learn}', partial(_bands, learn=learn), caption
    yield 'why', _why, 'when curves leave the band of people, and width of the band'


def draw_beside(
    measures: Sequence[Beside], folder: Path, name: str, title: str, columns: int = 5
) -> None:
    """
    Draw measures of P2 and of what replaces P2, one panel each.

    Args:
        measures: the measures; those without values get no panel.
        folder: folder for the files NAME.png and NAME.svg.
        name: name of the files.
        title: title of the figure.
        columns: number of columns.

    """
    shown = [one for one in measures if len(one.pairs)]
    with rc_context(STYLE):
        _save(_beside(shown, title, columns), folder / name)


def figure_count(panels: Sequence[Panel]) -> int:
    """Return the number of figures that `draw` makes of these cases."""
    configurations = {panel.case.configuration for panel in panels}
    return len(configurations) * (3 + len(panels[0].shown))


def _traces(group: Sequence[Panel], title: str) -> Figure:
    figure, grid = _grid(1, width=12.0, height=5.6, top=0.72)
    axes = grid[:, 0]
    trials = [(trial, panel.case) for panel in group for trial in panel.case.trials[:MAX_TRIALS]]
    pause = 0.25 * float(np.mean([trial.duration_s for trial, _ in trials]))
    start, boundaries = 0.0, []
    for index, (trial, case) in enumerate(trials):
        if index and trials[index - 1][1] is not case:
            boundaries.append(start)
            start += pause
        at = start + trial.times - trial.times[0]
        apart = np.linalg.norm(trial.partner - trial.demonstrator, axis=1)
        touching = at[apart <= apart.min() + EXCHANGE_BAND_M]
        for dimension, axis in enumerate(axes):
            axis.axvspan(touching[0], touching[-1], color=EXCHANGE_COLOUR, lw=0)
            axis.plot(at, trial.partner[:, dimension], color=PARTNER_COLOUR, lw=1.6)
            axis.plot(at, trial.demonstrator[:, dimension], color=DEMONSTRATOR_COLOUR, lw=1.6)
        middle = (at[0] + at[-1]) / 2
        axes[0].annotate(
            f'{trial.direction} {trial.number}',
            (middle, 1.0),
            xycoords=('data', 'axes fraction'),
            ha='center',
            va='bottom',
            color='#59626d',
            fontsize=8.5,
        )
        start = at[-1] + pause
    for axis in axes:
        axis.margins(x=0.01)
        for boundary in boundaries:
            axis.axvline(boundary, color='#9aa4af', lw=1.0, ls=(0, (4, 3)))
    axes[-1].set_xlabel('time, s (trials cut to the reach, one after the other)')
    _legend(
        figure,
        f'Wrists of P1 and P2: {title}',
        [
            Line2D([], [], color=PARTNER_COLOUR, lw=2, label='P1'),
            Line2D([], [], color=DEMONSTRATOR_COLOUR, lw=2, label='P2'),
            Patch(color=EXCHANGE_COLOUR, label='exchange'),
        ],
    )
    return figure


def _rollouts(group: Sequence[Panel], title: str) -> Figure:
    columns = [(panel, tested) for panel in group for tested in _shown(panel)]
    figure, axes = _grid(
        len(columns),
        width=max(NARROWEST, 3.1 * len(columns)),
        height=6.4,
        top=1.0,
        same_scale=True,
    )
    for column, (panel, tested) in zip(axes.T, columns, strict=True):
        trial = panel.case.trials[tested]
        rollout = panel.rollouts[tested, : len(trial.times)]
        at = trial.times - trial.times[0]
        for dimension, axis in enumerate(column):
            axis.plot(at, trial.partner[:, dimension], color=PARTNER_COLOUR, lw=1.6)
            # A broad line below a narrow one: both stay visible where they coincide.
            axis.plot(
                at, trial.demonstrator[:, dimension], color=DEMONSTRATOR_COLOUR, lw=4.0, alpha=0.55
            )
            axis.plot(at, rollout[:, dimension], color=DMP_COLOUR, lw=1.6)
            axis.xaxis.set_major_locator(MaxNLocator(5))
        learnt = panel.case.trials[panel.learnt].number
        what = 'the learnt trial' if tested == panel.learnt else 'other trial'
        column[0].set_title(
            f'{trial.direction}: {what}\nlearnt from {learnt}, tested against {trial.number}'
        )
        column[-1].set_xlabel('time, s')
    _legend(
        figure,
        f'The DMP replaces P2: {title}',
        [
            Line2D([], [], color=PARTNER_COLOUR, lw=2, label='P1'),
            Line2D([], [], color=DEMONSTRATOR_COLOUR, lw=4, alpha=0.55, label='P2'),
            Line2D([], [], color=DMP_COLOUR, lw=2, label='DMP'),
        ],
    )
    return figure


def _shown(panel: Panel) -> tuple[int, int]:
    """Choose the learnt trial and, of the others, the one with the median distance."""
    if panel.tested is not None:
        return panel.learnt, panel.tested

    def away_m2(index: int) -> float:
        trial = panel.case.trials[index]
        away = panel.rollouts[index, : len(trial.times)] - trial.demonstrator
        return float((away**2).sum(axis=1).mean())

    others = [index for index in range(len(panel.case)) if index != panel.learnt]
    return panel.learnt, sorted(others, key=away_m2)[len(others) // 2]


def _bands(group: Sequence[Panel], title: str, learn: str) -> Figure:
    figure, axes = _grid(
        len(group), width=max(NARROWEST, 5.2 * len(group) + 0.4), height=7.0, top=1.15
    )
    u = np.linspace(0.0, 1.0, group[0].case.curves.shape[1])
    for column, panel in zip(axes.T, group, strict=True):
        envelope = Envelope.of(panel.case.curves)
        shown = panel.shown[learn]
        chosen = np.unique(np.linspace(0, len(shown.curves) - 1, MAX_CURVES).astype(int))
        width = 1.4 if len(chosen) <= FEW_CURVES else 0.8
        for dimension, axis in enumerate(column):
            axis.margins(x=0.0)
            _draw_band(axis, u, envelope, dimension)
            for inside, colour in ((False, OUTSIDE_COLOUR), (True, INSIDE_COLOUR)):
                lines = chosen[shown.inside[chosen, dimension] == inside]
                axis.plot(
                    u, shown.curves[lines, :, dimension].T, color=colour, lw=width, alpha=0.65
                )
            axis.plot(u, envelope.mean[:, dimension], color='#111827', lw=1.8)
            axis.set_title(
                f'{round(shown.share[dimension] * shown.rollouts)} of {shown.rollouts} within 3σ',
                loc='right',
                fontsize=8.5,
                color='#59626d',
                pad=3,
            )
        figures = ', '.join(f'≤{k}σ {shown.within[k]:.0f} %' for k in BANDS)
        column[0].set_title(f'{panel.case.direction}\n{figures}\n', loc='left')
        column[-1].set_xlabel('time as a fraction of the duration')
    _legend(
        figure,
        f'Learn {learn}: {title}',
        [
            Line2D([], [], color='#111827', lw=2, label='mean of P2'),
            Patch(color=BAND_COLOURS[1], label='1σ'),
            Patch(color=BAND_COLOURS[3], label='3σ'),
            Line2D([], [], color=INSIDE_COLOUR, lw=1.5, label='DMP inside 3σ'),
            Line2D([], [], color=OUTSIDE_COLOUR, lw=1.5, label='outside'),
        ],
    )
    return figure


def _why(group: Sequence[Panel], title: str) -> Figure:
    figure, axes = _grid(
        len(group),
        width=max(NARROWEST, 5.2 * len(group) + 0.4),
        height=5.2,
        top=0.85,
        labels=('outside 3σ, %', '−3σ to 3σ, mm'),
    )
    neck_mm = 1e3 * group[0].rejections.min_width_m
    for (above, below), panel in zip(axes.T, group, strict=True):
        rejections = panel.rejections
        share = 100.0 * rejections.outside / max(1, rejections.curves // len(AXES))
        widths = 1e3 * rejections.widths_m
        u = np.linspace(0.0, 1.0, len(share))
        for dimension, colour in enumerate(AXES_COLOURS):
            above.plot(u, share[:, dimension], color=colour, lw=1.8)
            below.plot(u, widths[:, dimension], color=colour, lw=1.8)
        below.axhline(neck_mm, **NECK)
        above.set_title(
            f'{panel.case.direction}: {len(rejections.rejected)} of {rejections.curves} curves '
            f'leave the band, learn {rejections.learn}',
            loc='left',
        )
        above.set_ylim(0.0, max(SCALE_SHARE, 1.05 * float(share.max())))
        above.yaxis.set_major_locator(MaxNLocator(5, integer=True))
        below.set_ylim(bottom=0.0)
        above.margins(x=0.0)
        below.margins(x=0.0)
        below.set_xlabel('time as a fraction of the duration')
    _legend(
        figure,
        f'Why curves are rejected: {title}',
        [
            *(
                Line2D([], [], color=colour, lw=2, label=name)
                for name, colour in zip(AXES, AXES_COLOURS, strict=True)
            ),
            Line2D([], [], **NECK, label=f'{neck_mm:.0f} mm, a bottleneck below'),
        ],
    )
    return figure


def _beside(measures: Sequence[Beside], title: str, columns: int) -> Figure:
    rows = -(-len(measures) // columns)
    figure, axes = _grid(
        columns,
        width=2.9 * columns,
        height=1.15 + 2.3 * rows,
        top=0.85,
        labels=[''] * rows,
        row_gap=0.62,
    )
    for axis in axes.ravel()[len(measures):]:  # fmt: skip
        axis.remove()
    names = list(measures[0].values)
    for axis, one in zip(axes.ravel(), measures, strict=False):
        pairs = one.pairs
        if one.name in SKEWED:
            axis.set_yscale('log')
            axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.2, 1.5, 2.0, 3.0, 5.0)))
            axis.yaxis.set_major_formatter(StrMethodFormatter('{x:g}'))
            axis.yaxis.set_minor_formatter(NullFormatter())
        else:
            axis.yaxis.set_major_locator(MaxNLocator(5))
        heights = np.log(pairs) if one.name in SKEWED else pairs
        places = np.stack([_swarm(column) for column in heights.T], axis=1)
        places += np.arange(len(names))
        axis.plot(places.T, pairs.T, color='#9aa4af', lw=0.5, alpha=0.35)
        for place, who in enumerate(names):
            column = pairs[:, place]
            colour = MOVER_COLOURS[who]
            axis.plot(places[:, place], column, 'o', ms=3, color=colour, alpha=0.6, mew=0)
            middle = float(np.median(column))
            axis.plot([place - 0.3, place + 0.3], [middle, middle], color='#111827', lw=2.2)
        axis.set_title(one.words, loc='left', fontsize=9)
        axis.set_xlim(-0.45, len(names) - 0.55)
        axis.set_xticks(np.arange(len(names)), names)
        axis.tick_params(labelbottom=True)
    _legend(
        figure,
        title,
        [
            *(
                Line2D([], [], color=MOVER_COLOURS[who], marker='o', ls='', ms=5, label=who)
                for who in names
            ),
            Line2D([], [], color='#111827', lw=2.2, label='median'),
        ],
    )
    return figure


def _swarm(heights: Array) -> Array:
    """Move dots of equal height apart, (n,), as shares of the distance between columns."""
    span = float(np.ptp(heights)) or 1.0
    rows = np.round((heights - heights.min()) / span * SWARM_ROWS).astype(int)
    offsets = np.zeros(len(heights))
    for row in np.unique(rows):
        (own,) = np.nonzero(rows == row)
        step = min(SWARM_STEP, 2 * SWARM_REACH / max(len(own) - 1, 1))
        offsets[own] = step * (np.arange(len(own)) - 0.5 * (len(own) - 1))
    return offsets


def _grid(
    columns: int,
    *,
    width: float,
    height: float,
    top: float,
    labels: Sequence[str] = POSITION_LABELS,
    same_scale: bool = False,
    row_gap: float = _ROW_GAP,
) -> tuple[Figure, Any]:
    """
    Make rows of axes with fixed margins; an automatic layout would take most of the time.

    Args:
        columns: number of columns.
        width: width of the figure, inch.
        height: height of the figure, inch.
        top: space for title and legend, inch.
        labels: label of each row.
        same_scale: whether the axes of a row share their scale; then only the first has numbers.
        row_gap: gap between two rows, inch.

    Returns:
        The figure and its axes, (rows, columns).

    """
    left, right, bottom = 0.75, 0.15, 0.55
    rows = len(labels)
    between = 0.12 if same_scale else 0.65
    figure = Figure(figsize=(width, height))
    each = (width - left - right - between * (columns - 1)) / columns
    row = (height - top - bottom - (rows - 1) * row_gap) / rows
    axes = figure.subplots(
        rows,
        columns,
        sharex='col',
        sharey='row' if same_scale else False,
        squeeze=False,
        gridspec_kw={
            'left': left / width,
            'right': 1.0 - right / width,
            'bottom': bottom / height,
            'top': 1.0 - top / height,
            'wspace': between / each,
            'hspace': row_gap / row,
        },
    )
    for axis, label in zip(axes[:, 0], labels, strict=True):
        axis.set_ylabel(label)
        axis.yaxis.set_label_coords(-0.54 / each, 0.5)
    for axis in axes[-1]:
        axis.xaxis.set_label_coords(0.5, -0.31 / row)
    return figure, axes


def _draw_band(axis: Axes, u: Array, envelope: Envelope, dimension: int) -> None:
    mean, deviation = envelope.mean[:, dimension], envelope.deviation[:, dimension]
    for k, colour in BAND_COLOURS.items():
        axis.fill_between(u, mean - k * deviation, mean + k * deviation, color=colour, lw=0)


def _legend(figure: Figure, title: str, handles: list[Line2D | Patch]) -> None:
    place = (0.15 / figure.get_figwidth(), 1.0 - 0.15 / figure.get_figheight())
    figure.text(*place, title, ha='left', va='top', fontsize=13, fontweight='bold')
    figure.legend(
        handles=handles,
        loc='upper right',
        ncols=len(handles),
        bbox_to_anchor=(1.0 - 0.1 / figure.get_figwidth(), 1.0 - 0.08 / figure.get_figheight()),
        fontsize=9.5,
    )


def _save(figure: Figure, stem: Path) -> None:
    for suffix, options in _FORMATS.items():
        with replacing(stem.with_name(stem.name + suffix)) as temporary:
            figure.savefig(temporary, **options)
        # computed once for all formats
        figure.set_layout_engine('none')
