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

"""The words that the glossary has replaced are not in the code."""

from __future__ import annotations

import io
from pathlib import Path
import re
import tokenize

PACKAGE = Path(__file__).resolve().parents[1] / 'handover_dmp'
OLD_WORDS = re.compile(
    r'(least|most|longest|shortest)_\w+|_*(LEAST|MOST|LONGEST|SHORTEST)_\w+|p1|p2|chance'
    r'|agility|haste|feared|conduct|leaving|spinning|housekeeping|square_to|answering|labelled'
    r'|weights_in_time|_say|stretch(_\w+)?|human|\w*_posture|exchange|engine_bay'
)
# The library's own name, and what an option is called on the command line.
KEPT = {'least_squares', 'options.exchange', 'options.p1', 'options.p2'}


def test_no_old_word_is_a_name() -> None:
    found = []
    for file in PACKAGE.rglob('*.py'):
        before = ['', '']
        text = file.read_text(encoding='utf-8')
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.NAME and OLD_WORDS.fullmatch(token.string):
                owner = before[0] if before[1] == '.' else ''
                name = f'{owner}.{token.string}' if owner == 'options' else token.string
                if name not in KEPT:
                    found.append(f'{file.relative_to(PACKAGE)}:{token.start[0]}: {name}')
            before = [before[1], token.string]
    assert found == []
