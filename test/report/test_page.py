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

from __future__ import annotations

from pathlib import Path

from handover_dmp.report.page import as_html, as_markdown, Page, Section, Table

EVIL = '<script>alert(1)</script>'
PAGE = Page(
    EVIL,
    EVIL,
    False,
    (
        Section(EVIL, text=EVIL, code=EVIL),
        Section('tables', tables=(Table((EVIL, 'b'), ((EVIL, 'one|two'),)), Table((), ()))),
    ),
)


def test_what_a_bag_says_cannot_become_markup() -> None:
    text = as_html(PAGE, Path())
    assert '<script' not in text
    assert text.count('&lt;script&gt;alert(1)&lt;/script&gt;') == 8


def test_a_bar_in_a_cell_does_not_end_it() -> None:
    (row,) = [line for line in as_markdown(PAGE).splitlines() if 'one' in line]
    assert row == f'| {EVIL} | one\\|two |'


def test_the_outcome_is_seen() -> None:
    assert 'class="outcome failed"' in as_html(PAGE, Path())
    assert 'class="outcome"' in as_html(Page('a', 'b', True, ()), Path())
