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

"""Units of length, by the names that mocap programs and people use."""

from __future__ import annotations

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.tables import quote

METRES = {'m': 1.0, 'cm': 0.01, 'mm': 0.001, 'in': 0.0254, 'ft': 0.3048}
_WORDS = {
    'm': ('meter', 'meters', 'metre', 'metres'),
    'cm': ('centimeter', 'centimeters', 'centimetre', 'centimetres'),
    'mm': ('millimeter', 'millimeters', 'millimetre', 'millimetres'),
    'in': ('inch', 'inches'),
    'ft': ('foot', 'feet'),
}
_UNITS = {unit: unit for unit in METRES} | {
    word: unit for unit, words in _WORDS.items() for word in words
}


def unit_of(text: str) -> str | None:
    """
    Parse a unit of length.

    Args:
        text: text from a file or a user, e.g. `mm`, `Meters`, `[cm]`.

    Returns:
        `m`, `cm`, `mm`, `in` or `ft`; None for anything else.

    """
    return _UNITS.get(text.strip(' \0\t[]().').lower())


def known_unit(text: str, source: str) -> str:
    """
    Parse the unit of a file.

    Args:
        text: text from the file.
        source: the file, for the error.

    Returns:
        `m`, `cm`, `mm`, `in` or `ft`.

    Raises:
        DataError: the text is no unit of length.

    """
    unit = unit_of(text)
    if unit is None:
        known = ', '.join(METRES)
        raise DataError(
            f'{source}: unit {quote(text)} is not one of {known}; say which with --unit'
        )
    return unit
