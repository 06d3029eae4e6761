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

"""`import.html`: every imported trial on one page, to be seen before it is believed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from io import StringIO

from handover_dmp.mocap.review import Review
from matplotlib.figure import Figure

_COLOURS = (('P1', 'tab:blue'), ('P2', 'tab:orange'))
_STYLE = (
    'body{font:16px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#222}'
    'svg{width:100%;height:auto}h2{margin:2em 0 0}.warning{color:#a33}dl{display:grid;'
    'grid-template-columns:max-content auto;gap:0 1em}dd{margin:0}'
)


def review_page(reviews: Sequence[Review], title: str) -> str:
    """
    Show every trial: both wrists over time and from above, its facts, and what is unusual.

    Args:
        reviews: of the trials.
        title: of the page.

    Returns:
        The page, HTML, with everything within it.

    """
    odd = sum(bool(one.warnings) for one in reviews)
    parts = [
        '<!DOCTYPE html><html lang="en"><meta charset="utf-8">',
        f'<title>{escape(title)}</title><style>{_STYLE}</style><h1>{escape(title)}</h1>',
        f'<p>{len(reviews)} trials, {odd} of them unusual. Lengths in m, z up; '
        'grey: samples are missing.</p>',
        *map(_section, reviews),
        '</html>',
    ]
    return '\n'.join(parts)


def _section(one: Review) -> str:
    trial = one.trial
    facts = {
        'from': trial.source,
        'duration, rate': f'{trial.duration_s:.2f} s, {trial.rate_hz:.4g} Hz',
        'unit of the file': one.unit,
        'axis that points up': one.up,
        'peak speed': f'P1 {one.peak_speeds[0]:.2f} m/s, P2 {one.peak_speeds[1]:.2f} m/s',
        'nearest distance': f'{one.nearest_m:.2f} m',
    }
    rows = ''.join(f'<dt>{name}<dd>{escape(value)}' for name, value in facts.items())
    warnings = ''.join(f'<p class="warning">{escape(text)}</p>' for text in one.warnings)
    return f'<h2>{escape(trial.label)}</h2>{warnings}<dl>{rows}</dl>{_drawing(one)}'


def _drawing(one: Review) -> str:
    trial = one.trial
    figure = Figure(figsize=(9.5, 3.2), layout='constrained')
    *over_time, above = figure.subplots(1, 4, width_ratios=(1, 1, 1, 1.3))
    for axis, name in enumerate('xyz'):
        axes = over_time[axis]
        for (who, colour), wrist in zip(
            _COLOURS, (trial.partner, trial.demonstrator), strict=True
        ):
            axes.plot(trial.times, wrist[:, axis], color=colour, lw=1.4, label=who)
        for start_s, end_s in one.gaps:
            axes.axvspan(start_s, end_s, color='0.85', lw=0)
        axes.set(title=f'{name} / m', xlabel='time / s')
    over_time[0].legend(frameon=False)
    for (_, colour), wrist in zip(_COLOURS, (trial.partner, trial.demonstrator), strict=True):
        above.plot(wrist[:, 0], wrist[:, 1], color=colour, lw=1.4)
        above.plot(*wrist[0, :2], 'o', color=colour)
    above.set(title='from above (dot: start)', xlabel='x / m', ylabel='y / m')
    above.set_aspect('equal', adjustable='datalim')
    for axes in (*over_time, above):
        axes.grid(alpha=0.25)
        axes.spines[['top', 'right']].set_visible(False)
    text = StringIO()
    figure.savefig(text, format='svg')
    return text.getvalue().partition('<svg')[1] + text.getvalue().partition('<svg')[2]
