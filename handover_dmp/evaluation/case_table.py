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

"""A table with one line per case or measure, for the terminal and the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

NEW_LINE = '\n'
MAX_WIDTH = 400
"""Width that suffices for any table, characters."""


@dataclass(frozen=True)
class CaseTable:
    """
    The table.

    Attributes:
        title: its heading.
        note: explanation of the columns.
        head: column headings, the first of text, the others of numbers; empty: no table.
        lines: cells, one line per case or measure.
        total: cells over all cases; empty if a total means nothing.
        remarks: paragraphs below the table.

    """

    title: str
    note: str
    head: tuple[str, ...]
    lines: Sequence[Sequence[str]]
    total: Sequence[str] = ()
    remarks: Sequence[str] = ()

    def _as_table(self) -> Table:
        table = table_with_columns(self.head[:1], self.head[1:])
        for line in self.lines:
            table.add_row(*line)
        if self.total:
            table.add_section()
            table.add_row(*self.total, style='bold')
        return table

    def show(self, console: Console) -> None:
        """
        Print the table with its note and remarks.

        Args:
            console: output; widened to fit the table.

        """
        console.print(heading(self.title))
        if self.head:
            table = self._as_table()
            options = console.options.update(width=MAX_WIDTH)
            console.width = max(console.width, console.measure(table, options=options).maximum)
            console.print(table)
        for text in filter(None, (self.note, *self.remarks)):
            console.print(text, '', sep='\n', highlight=False)

    def as_html(self) -> str:
        """Return HTML: heading, note, table, remarks."""
        parts = [f'<h2>{escape(self.title)}</h2>']
        if self.note:
            parts.append(f'<p class="soft">{escape(self.note)}</p>')
        if self.head:
            head = ''.join(
                f'<th{_kind(number)}>{escape(name).replace(NEW_LINE, "<br>")}</th>'
                for number, name in enumerate(self.head)
            )
            body = ''.join(f'<tr>{_cells(line)}</tr>' for line in self.lines)
            if self.total:
                body += f'<tr class="sum">{_cells(self.total)}</tr>'
            parts.append(
                f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
                f'<tbody>{body}</tbody></table></div>'
            )
        parts += [f'<p>{escape(remark)}</p>' for remark in self.remarks]
        return NEW_LINE.join(parts)


def table_with_columns(of_text: Sequence[str], of_numbers: Sequence[str] = ()) -> Table:
    """Make an empty table for rich, from the headings of its columns."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for name in of_text:
        table.add_column(name, no_wrap=True)
    for name in of_numbers:
        table.add_column(name, justify='right', no_wrap=True)
    return table


def heading(title: str) -> Text:
    """Make the heading of a table for rich; it stays on one line, however narrow the table."""
    return Text(title, style='bold', no_wrap=True, overflow='ignore')


def case_name(configuration: str, direction: str) -> str:
    """Return the name of a case for tables and sentences."""
    return f'{configuration} {direction}'.strip()


def name_of(case: Mapping[str, Any]) -> str:
    """Return the name of a case, or of the case of a trial, from `table.json`."""
    return case_name(case['configuration'], case['exchange'])


def _cells(line: Sequence[str]) -> str:
    return ''.join(f'<td{_kind(number)}>{escape(cell)}</td>' for number, cell in enumerate(line))


def _kind(number: int) -> str:
    return '' if number else ' class="text"'
