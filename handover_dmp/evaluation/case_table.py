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

"""A table of one line a case and one over all, for the terminal and for the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

TEXT_COLUMNS = 2
"""Configuration and exchange; the others are numbers."""
NEW_LINE = '\n'
MAX_WIDTH = 400
"""Characters that no table needs."""


@dataclass(frozen=True)
class CaseTable:
    """
    The table.

    Attributes:
        title: its heading.
        note: what the columns mean, in sentences.
        head: of the columns; the first two are configuration and exchange; none: no table.
        lines: cells, a line a case.
        total: cells over all cases; none where that means nothing.
        remarks: sentences below the table, a paragraph each.

    """

    title: str
    note: str
    head: tuple[str, ...]
    lines: Sequence[Sequence[str]]
    total: Sequence[str] = ()
    remarks: Sequence[str] = ()

    def as_renderable(self) -> Table:
        """Lay it out for rich."""
        table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1), title=self.title)
        for number, name in enumerate(self.head):
            justify: Any = 'left' if number < TEXT_COLUMNS else 'right'
            table.add_column(name, justify=justify, no_wrap=True)
        for line in self.lines:
            table.add_row(*line)
        if self.total:
            table.add_section()
            table.add_row(*self.total, style='bold')
        return table

    def show(self, console: Console) -> None:
        """
        Print it with its remarks.

        Args:
            console: where to; made as wide as the table needs.

        """
        table = self.as_renderable()
        needed = console.measure(table, options=console.options.update(width=MAX_WIDTH)).maximum
        console.width = max(console.width, needed)
        console.print(table, *self.remarks, sep='\n', highlight=False)

    def as_html(self) -> str:
        """Lay it out for the page: heading, note, table, remarks."""
        title = f'<h2>{escape(self.title)}</h2>\n<p class="soft">{escape(self.note)}</p>'
        if not self.head:
            return title
        head = ''.join(
            f'<th{_kind(number)}>{escape(name).replace(NEW_LINE, "<br>")}</th>'
            for number, name in enumerate(self.head)
        )
        body = ''.join(f'<tr>{_cells(line)}</tr>' for line in self.lines)
        if self.total:
            body += f'<tr class="sum">{_cells(self.total)}</tr>'
        return (
            f'{title}\n<div class="wide"><table><thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>'
            + ''.join(f'\n<p>{escape(remark)}</p>' for remark in self.remarks)
        )


def _cells(line: Sequence[str]) -> str:
    return ''.join(f'<td{_kind(number)}>{escape(cell)}</td>' for number, cell in enumerate(line))


def _kind(number: int) -> str:
    return ' class="text"' if number < TEXT_COLUMNS else ''
