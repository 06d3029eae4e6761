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

"""A page of text, tables and figures, as Markdown and as one file of HTML."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from html import escape
from pathlib import Path

STYLE = """
:root { color-scheme: light; --ink: #1b2430; --soft: #59626d; --line: #dde2e8; --tint: #f5f7f9; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 62rem; padding: 2.2rem 1.4rem 4rem; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.8rem; margin: 0 0 .4rem; } h2 { font-size: 1.25rem; margin: 2.4rem 0 .7rem; }
p { color: var(--soft); }
.outcome { display: inline-block; padding: .25rem .8rem; border-radius: 6px; font-weight: 600;
  color: #fff; background: #1f6b43; } .outcome.failed { background: #a3271f; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums;
  margin: 0 0 1.2rem; }
th, td { padding: .32rem .9rem .32rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; } td.value { white-space: nowrap; font-weight: 600; }
figure { margin: 0 0 1.8rem; } img { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .92rem; padding-top: .4rem; }
.row { display: flex; gap: .6rem; } .row img { min-width: 0; flex: 1 1 0; border-radius: 6px; }
pre { background: var(--tint); border: 1px solid var(--line); border-radius: 6px;
  padding: .8rem 1rem; white-space: pre-wrap; }
"""


@dataclass(frozen=True)
class Table:
    """
    A table.

    Attributes:
        head: column headings; empty for a list of facts (name, value and note).
        rows: cells of each row.

    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """
    A section of a page.

    Attributes:
        title: its heading.
        text: a paragraph.
        code: a command to copy.
        tables: its tables.
        images: paths of pictures shown side by side.
        figures: path and caption of each figure.

    """

    title: str
    text: str = ''
    code: str = ''
    tables: tuple[Table, ...] = ()
    images: tuple[str, ...] = ()
    figures: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Page:
    """
    A page.

    Attributes:
        title: its heading.
        outcome: the result, in one sentence.
        good: whether the result is a success.
        sections: its sections.

    """

    title: str
    outcome: str
    good: bool
    sections: tuple[Section, ...]


def as_markdown(page: Page) -> str:
    """
    Write the page as Markdown that links to its pictures.

    Args:
        page: what to write.

    Returns:
        The text.

    """
    lines = [f'# {page.title}', '', f'**{page.outcome}**', '']
    for section in page.sections:
        lines += [f'## {section.title}', '']
        if section.text:
            lines += [section.text, '']
        if section.code:
            lines += [f'    {section.code}', '']
        for table in section.tables:
            width = max((len(row) for row in table.rows), default=len(table.head) or 1)
            head = [*table.head, *[''] * (width - len(table.head))]
            for row in (head, ['---'] * width, *table.rows):
                lines.append('| ' + ' | '.join(_cell(one) for one in row) + ' |')
            lines.append('')
        if section.images:
            lines += [' '.join(f'![]({image})' for image in section.images), '']
        for path, caption in section.figures:
            lines += [f'![{caption}]({path})', '', f'*{caption}*', '']
    return '\n'.join(lines)


def as_html(page: Page, folder: Path) -> str:
    """
    Write the page as one self-contained HTML file.

    Args:
        page: what to write.
        folder: base of the relative picture paths.

    Returns:
        The text.

    """
    kind = 'outcome' if page.good else 'outcome failed'
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<title>{escape(page.title)}</title><style>{STYLE}</style></head><body>',
        f'<h1>{escape(page.title)}</h1><div class="{kind}">{escape(page.outcome)}</div>',
    ]
    for section in page.sections:
        parts.append(f'<h2>{escape(section.title)}</h2>')
        if section.text:
            parts.append(f'<p>{escape(section.text)}</p>')
        if section.code:
            parts.append(f'<pre>{escape(section.code)}</pre>')
        parts += [_table(table) for table in section.tables]
        if section.images:
            images = ''.join(_image(folder / path, '') for path in section.images)
            parts.append(f'<div class="row">{images}</div>')
        for path, caption in section.figures:
            parts.append(
                f'<figure>{_image(folder / path, caption)}'
                f'<figcaption>{escape(caption)}</figcaption></figure>'
            )
    parts.append('</body></html>')
    return '\n'.join(parts) + '\n'


def _table(table: Table) -> str:
    parts = ['<div class="wide"><table>']
    if table.head:
        parts.append('<tr>' + ''.join(f'<th>{escape(one)}</th>' for one in table.head) + '</tr>')
    for row in table.rows:
        kinds = ['', ' class="value"' if not table.head and len(row) > 2 else '']
        cells = [
            f'<td{kinds[index] if index < 2 else ""}>{escape(one)}</td>'
            for index, one in enumerate(row)
        ]
        parts.append('<tr>' + ''.join(cells) + '</tr>')
    return ''.join(parts) + '</table></div>'


def _image(path: Path, caption: str) -> str:
    data = b64encode(path.read_bytes()).decode()
    return f'<img alt="{escape(caption)}" src="data:image/png;base64,{data}">'


def _cell(text: str) -> str:
    return text.replace('|', '\\|').replace('\n', ' ')
