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

"""Cells of tables: a number of a report, with its unit."""

from __future__ import annotations

from typing import Any


def look_up(found: Any, *keys: str) -> float | None:
    """
    Look a number up in nested results.

    Args:
        found: content of `report.json`, or a part of it.
        keys: the keys that lead to the number, from the outside in.

    Returns:
        The number; None if it, or what it would be in, is unknown.

    """
    for key in keys:
        found = None if found is None else found[key]
    return None if found is None else float(found)


def quantity(value: float | None, factor: float, unit: str, digits: int) -> str:
    """
    Write a number with its unit.

    Args:
        value: the number; None: unknown.
        factor: from the number to one in this unit.
        unit: the unit; may be empty.
        digits: number of decimal places.

    Returns:
        The text; a dash for an unknown number.

    """
    return '–' if value is None else f'{factor * value:.{digits}f} {unit}'.strip()
