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

"""The page with the tables and all figures; it needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
import math

from handover_dmp.common.digits import rounded
from handover_dmp.evaluation.scores import BANDS
from handover_dmp.evaluation.table import each_once, millis, paper_table, Row, TITLE, TITLES

_STYLE = """
:root { color-scheme: light; --ink: #1b2430; --soft: #5b6673; --line: #dde2e8; --tint: #f5f7f9; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 2.5rem 1.5rem 4rem; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.9rem; margin: 0 0 .3rem; letter-spacing: -.01em; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .8rem; }
p, dl { max-width: 60rem; } dt { font-weight: 600; float: left; clear: left; width: 9.5rem; }
dd { margin: 0 0 .45rem 9.5rem; } .soft { color: var(--soft); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { padding: .32rem .75rem; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
th { font-weight: 600; color: var(--soft); vertical-align: bottom; }
td.text, th.text { text-align: left; }
thead tr:last-child th { border-bottom: 2px solid var(--ink); }
th.group { text-align: center; border-left: 1px solid var(--line); }
td.first, th.first { border-left: 1px solid var(--line); }
tr.sum td { font-weight: 650; background: var(--tint); border-top: 2px solid var(--ink); }
tr.paper td { color: var(--soft); font-style: italic; }
small { color: var(--soft); font-weight: 400; }
figure { margin: 0 0 2.2rem; } figure img { width: 100%; height: auto; display: block;
  border: 1px solid var(--line); border-radius: 8px; padding: .6rem; background: #fff; }
figcaption { color: var(--soft); font-size: .92rem; padding: .5rem .2rem; }
a { color: #1f5fb4; }
nav a { margin-right: 1.1rem; }
"""


def picture(name: str, caption: str) -> str:
    """
    Show a figure.

    Args:
        name: name of the files NAME.svg and NAME.png in `figures/` beside the page.
        caption: caption below the figure.

    Returns:
        HTML.

    """
    return (
        f'<figure id="{escape(name)}"><img src="figures/{escape(name)}.svg" loading="lazy" '
        f'alt="{escape(caption)}"><figcaption>{escape(caption)} · '
        f'<a href="figures/{escape(name)}.png">PNG</a> · '
        f'<a href="figures/{escape(name)}.svg">SVG</a></figcaption></figure>'
    )


def page(
    title: str,
    facts: Iterable[str],
    in_short: Mapping[str, str],
    rows: Sequence[Row],
    summary: Sequence[Row],
    sections: Sequence[str] = (),
    figures: Sequence[tuple[str, str]] = (),
) -> str:
    """
    Write the page.

    Args:
        title: its heading.
        facts: sentences on what was evaluated and how.
        in_short: answers by question.
        rows: rows of the cases.
        summary: rows over all cases.
        sections: HTML between the paper's tables and the figures.
        figures: name and caption of the figures at the end.

    Returns:
        HTML; it loads nothing but those figures.

    """
    answers = ''.join(
        f'<dt>{escape(question)}</dt><dd>{escape(answer)}</dd>'
        for question, answer in in_short.items()
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>{escape(title)}</h1>
<p class="soft">{escape(' '.join(facts))}</p>
<nav><a href="table.txt">table.txt</a><a href="table.csv">table.csv</a><a
href="table.json">table.json</a></nav>
<h2>In short</h2>
<dl>{answers}</dl>
<h2>{TITLE}</h2>
<div class="wide"><table>{_paper_table(rows, summary)}</table></div>
<h2>All cases, every method</h2>
<p class="soft">In brackets: 95 % interval from resampled trials. Distance: root mean square to P2
in the same trial. End: mean distance to P2's position at the exchange. P2 itself is compared with
mean and band of the other trials; this is the upper bound for any imitation. Shifted: distance
after each motion is shifted in time to its best fit. Late by: that shift (mean ± standard
deviation).</p>
<div class="wide"><table>{_methods_table(summary)}</table></div>
{chr(10).join(sections)}
{'<h2>Figures</h2>' if figures else ''}
{chr(10).join(picture(*figure) for figure in figures)}
</body>
</html>
"""


def _paper_table(rows: Sequence[Row], summary: Sequence[Row]) -> str:
    shown = paper_table(rows, summary)
    head = '<th class="text" rowspan="2">configuration</th><th class="text" rowspan="2">exchange'
    head += '</th><th rowspan="2">trials</th>'
    head += ''.join(f'<th class="group" colspan="3">learn {learn}</th>' for learn in shown.learns)
    bands = _cells('th', [f'≤{k}σ' for _ in shown.learns for k in BANDS])
    lines = [
        _line('', configuration.replace('_', ' '), direction, trials, percentages)
        for configuration, direction, trials, percentages in shown.cases
    ]
    lines.append(_line('sum', 'all', '', shown.trials, shown.total))
    lines.append(
        '<tr class="paper"><td class="text" colspan="2">the paper, its own recordings</td>'
        f'<td>30</td>{_cells("td", shown.paper)}</tr>'
    )
    return f'<thead><tr>{head}</tr><tr>{bands}</tr></thead><tbody>{"".join(lines)}</tbody>'


def _line(
    kind: str, configuration: str, direction: str, trials: int, percentages: Sequence[str]
) -> str:
    return (
        f'<tr class="{kind}"><td class="text">{escape(configuration)}</td>'
        f'<td class="text">{direction}</td><td>{trials}</td>{_cells("td", percentages)}</tr>'
    )


def _methods_table(summary: Sequence[Row]) -> str:
    bands = ''.join(f'<th>≤{k}σ, %</th>' for k in BANDS)
    head = '<th class="text">method</th><th class="text">learn</th><th>curves</th>'
    head += f'{bands}<th>distance, mm</th><th>end, mm</th><th>shifted, mm</th><th>late by, ms</th>'
    lines = []
    for row, learn in each_once(summary):
        figures = row.figures
        cells = [_number(figures.within[k], figures.within_interval[k]) for k in BANDS]
        cells.append(_number(1e3 * figures.rms_m, [1e3 * m for m in figures.rms_interval_m]))
        cells += [millis(figures.final_gap_m), millis(figures.shifted_rms_m, 1)]
        late = '–'
        if not math.isnan(figures.lateness_s):
            spread = f'± {1e3 * figures.lateness_deviation_s:.0f}'
            late = f'{rounded(1e3 * figures.lateness_s, 0, "+")} <small>{spread}</small>'
        lines.append(
            f'<tr><td class="text">{TITLES[row.method]}</td>'
            f'<td class="text">{learn}</td><td>{row.curves}</td>'
            f'{"".join(f"<td>{cell}</td>" for cell in (*cells, late))}</tr>'
        )
    return f'<thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody>'


def _cells(tag: str, texts: Sequence[str]) -> str:
    """Make cells, with a line before the first band of each source of learning."""
    return ''.join(
        f'<{tag}>{text}</{tag}>' if number % len(BANDS) else f'<{tag} class="first">{text}</{tag}>'
        for number, text in enumerate(texts)
    )


def _number(value: float, ends: Sequence[float]) -> str:
    if math.isnan(value):
        return '–'
    return f'{value:.1f} <small>[{ends[0]:.0f}–{ends[1]:.0f}]</small>'
