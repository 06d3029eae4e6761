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

"""`import.html`: all imported trials on one page, for review."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from io import StringIO
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.review import Review
from handover_dmp.mocap.wrists import STAMP_ROUNDING_S
from matplotlib import rc_context
from matplotlib.figure import Figure
import numpy as np

# reused, because a new layout for each of a hundred trials would take a minute more
_GRID: dict[str, Any] = {
    'left': 0.06, 'right': 0.99, 'bottom': 0.17, 'top': 0.9, 'wspace': 0.38,
    'width_ratios': (1, 1, 1, 1.3),
}  # fmt: skip
_COLOURS = (('P1', 'tab:blue'), ('P2', 'tab:orange'))
_STYLE = (
    'body{font:16px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#222}'
    'svg{width:100%;height:auto}h2{margin:2em 0 0}.warning{color:#a33}dl{display:grid;'
    'grid-template-columns:max-content auto;gap:0 1em}dd{margin:0}.warning{margin:.2em 0}'
)


def review_page(reviews: Sequence[Review], title: str) -> str:
    """
    Show every trial: both wrists over time and from above, its facts, and what is unusual.

    Args:
        reviews: reviews of the trials.
        title: title of the page.

    Returns:
        The page, self-contained HTML.

    """
    odd = [number for number, one in enumerate(reviews) if one.warnings]
    links = ', '.join(
        f'<a href="#trial{number}">{escape(reviews[number].trial.label)}</a>' for number in odd
    )
    count = f'{len(reviews)} trial' if len(reviews) == 1 else f'{len(reviews)} trials'
    parts = [
        '<!DOCTYPE html><html lang="en"><meta charset="utf-8">',
        f'<title>{escape(title)}</title><style>{_STYLE}</style><h1>{escape(title)}</h1>',
        f'<p>{count}. Check these before use: {links or "none"}.</p>',
        '<p>Lengths in m, z up. Shading in the colour of a wrist: the wrist was not seen.</p>',
        *(_section(one, number) for number, one in enumerate(reviews)),
        '</html>',
    ]
    return '\n'.join(parts)


def _section(one: Review, number: int) -> str:
    trial = one.trial
    facts = {
        'from': trial.source,
        'duration, rate': f'{trial.duration_s:.2f} s, {trial.rate_hz:.4g} Hz',
        'unit of the file': one.unit,
        'axis that points up': one.up,
        'peak speed': f'P1 {one.peak_speeds[0]:.2f} m/s, P2 {one.peak_speeds[1]:.2f} m/s',
        'nearest distance': f'{one.nearest_m:.2f} m',
        'gaps': ', '.join(f'{gap.who} {gap.start_s:.2f} to {gap.end_s:.2f} s' for gap in one.gaps)
        or 'none',
    }
    rows = ''.join(f'<dt>{name}<dd>{escape(value)}' for name, value in facts.items())
    warnings = ''.join(f'<p class="warning">{escape(text)}</p>' for text in one.warnings)
    title = f'<h2 id="trial{number}">{escape(trial.label)}</h2>'
    return f'{title}{warnings}<dl>{rows}</dl>{_drawing(one)}'


def _drawing(one: Review) -> str:
    lines = [_broken(one, who) for who, _ in _COLOURS]
    figure = Figure(figsize=(9.5, 3.2))
    *over_time, above = figure.subplots(1, 4, gridspec_kw=_GRID)
    for axis, name in enumerate('xyz'):
        axes = over_time[axis]
        for (who, colour), line in zip(_COLOURS, lines, strict=True):
            axes.plot(line[:, 0], line[:, 1 + axis], color=colour, lw=1.4, label=who)
            for gap in one.gaps:
                if gap.who == who:
                    axes.axvspan(gap.start_s, gap.end_s, color=colour, alpha=0.2, lw=0)
        axes.set(title=f'{name} / m', xlabel='time / s')
    over_time[0].legend(frameon=False)
    for (_, colour), line in zip(_COLOURS, lines, strict=True):
        above.plot(line[:, 1], line[:, 2], color=colour, lw=1.4)
        above.plot(*line[0, 1:3], 'o', color=colour)
    above.set(title='from above (dot: start)', xlabel='x / m', ylabel='y / m')
    above.set_aspect('equal', adjustable='datalim')
    for axes in (*over_time, above):
        axes.grid(alpha=0.25)
        axes.spines[['top', 'right']].set_visible(False)
    text = StringIO()
    with rc_context({'svg.fonttype': 'none'}):
        figure.savefig(text, format='svg')
    return text.getvalue().partition('<svg')[1] + text.getvalue().partition('<svg')[2]


def _broken(one: Review, who: str) -> Array:
    """Return times and positions of a wrist, NaN in its gaps."""
    trial = one.trial
    line = np.column_stack([trial.times, trial.partner if who == 'P1' else trial.demonstrator])
    for gap in one.gaps:
        if gap.who == who:
            line[gap.hides(trial.times), 1:] = np.nan
    ends = np.searchsorted(trial.times, [gap.end_s - STAMP_ROUNDING_S for gap in one.gaps])
    return np.insert(line, ends[(ends > 0) & (ends < len(line))], np.nan, axis=0)
