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
