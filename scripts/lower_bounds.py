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
Writes the lower bounds of the requirements of this package for pip, in two parts.

    python scripts/lower_bounds.py > lowest.txt
    python scripts/lower_bounds.py pinocchio > lowest-pinocchio.txt
    pip install -r lowest.txt
    pip install --no-deps -r lowest-pinocchio.txt
    pip install --no-deps --editable .

The wheels of Pinocchio work with NumPy 1.26, but declare that they need 2.0, so pip fails. The
Pinocchio of a ROS 2 installation is built with the NumPy of its system.
"""

from __future__ import annotations

from pathlib import Path
import re
import sys

SETUP = Path(__file__).resolve().parents[1] / 'setup.py'
REQUIREMENT = re.compile(r"^ +'([\w.-]+)(\[\w+\])?>=([\d.]+)[^;']*(;[^']*)?',$", re.MULTILINE)
EXTRAS = ('ros', 'test')
WITH_PINOCCHIO = ('coal', 'eigenpy', 'pin')
# the packages of Pinocchio, which have no dependencies other than these
OF_PINOCCHIO = (
    'cmeel', 'cmeel-assimp~=6.0', 'cmeel-boost~=1.90.0', 'cmeel-console-bridge',
    'cmeel-octomap~=1.10', 'cmeel-qhull~=8.0.2.1', 'cmeel-tinyxml2', 'cmeel-urdfdom', 'cmeel-zlib',
)  # fmt: skip
LIBRARIES = {'coal': 'libcoal', 'pin': 'libpinocchio'}


def lower_bounds(with_pinocchio: bool) -> list[str]:
    """
    Read the lower bounds from `setup.py`, without an installation.

    Args:
        with_pinocchio: whether to return those of Pinocchio and its packages, or all others.

    Returns:
        One line per requirement of the package itself, of ROS and of the tests.

    """
    text = SETUP.read_text(encoding='utf-8')
    parts = [re.search(r'^REQUIREMENTS = \[$(.*?)^\]$', text, re.MULTILINE | re.DOTALL)]
    parts += [
        re.search(rf"^    '{extra}': \[$(.*?)^    \],$", text, re.MULTILINE | re.DOTALL)
        for extra in EXTRAS
    ]
    found = [
        (name, f'{name}{extra}=={version}{marker}', version)
        for part in parts
        if part is not None
        for name, extra, version, marker in REQUIREMENT.findall(part.group(1))
        if (name in WITH_PINOCCHIO) == with_pinocchio
    ]
    lines = [line for _, line, _ in found]
    if with_pinocchio:
        lines += [f'{LIBRARIES[name]}=={bound}' for name, _, bound in found if name in LIBRARIES]
        lines += OF_PINOCCHIO
    return lines


if __name__ == '__main__':
    print('\n'.join(lower_bounds(with_pinocchio=sys.argv[1:] == ['pinocchio'])))
