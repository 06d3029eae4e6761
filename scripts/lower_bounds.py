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

"""
Writes the lower bounds of what this package requires as constraints for pip.

    python scripts/lower_bounds.py > lowest.txt
    pip install --constraint lowest.txt --editable '.[ros,test]'
"""

from __future__ import annotations

from pathlib import Path
import re

SETUP = Path(__file__).resolve().parents[1] / 'setup.py'
REQUIREMENT = re.compile(r"^ +'([\w.-]+)(?:\[\w+\])?>=([\d.]+)[^;']*(;[^']*)?',$", re.MULTILINE)
EXTRAS = ('ros', 'test')


def lower_bounds() -> list[str]:
    """
    Read them out of `setup.py`, which no installation is needed for.

    Returns:
        One line a requirement of the package itself, of ROS and of the tests.

    """
    text = SETUP.read_text(encoding='utf-8')
    parts = [re.search(r'^REQUIREMENTS = \[$(.*?)^\]$', text, re.MULTILINE | re.DOTALL)]
    parts += [
        re.search(rf"^    '{extra}': \[$(.*?)^    \],$", text, re.MULTILINE | re.DOTALL)
        for extra in EXTRAS
    ]
    return [
        f'{name}=={version}{marker}'
        for part in parts
        if part is not None
        for name, version, marker in REQUIREMENT.findall(part.group(1))
    ]


if __name__ == '__main__':
    print('\n'.join(lower_bounds()))
