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

"""Whether the file of a mesh holds one: it may be cut off, or of a format that nobody reads."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
import re

import coal
from handover_dmp.common.quiet_pybullet import silenced
import pinocchio as pin

LOADER = coal.CachedMeshLoader()
"""Reads every mesh once, however often an arm is loaded."""
DRAWN = ('.dae', '.obj', '.stl')
"""Formats that pictures can be made of."""
ENDS = 512
"""Bytes at either end of a file that are looked at."""
STL_HEAD, STL_FACET = 84, 50
"""Bytes of a binary STL file before its facets, and of each."""


def why_not_collided(path: Path, scale: Sequence[float]) -> str:
    """
    Say why nothing can collide with a mesh.

    Args:
        path: its file.
        scale: three factors.

    Returns:
        The reason; empty where the mesh can be read.

    """
    place = ' '.join(map(repr, map(float, scale)))
    shape = f'<mesh filename="{escape(str(path))}" scale="{place}"/>'
    link = f'<link name="l"><collision><geometry>{shape}</geometry></collision></link>'
    try:
        # the loader keeps what Pinocchio has it read, and that alone
        with silenced():
            _read_collisions(f'<robot name="r">{link}</robot>')
    except (ValueError, RuntimeError) as error:
        reason = re.search(r'message: (.*?)(\nHint:|$)', str(error), re.DOTALL)
        words = (reason[1] if reason else str(error)).replace(
            f'Could not load resource {path}', ''
        )
        return ' '.join(words.replace(str(path), path.name).split()).rstrip('.') or 'not a mesh'
    return ''


def _read_collisions(urdf: str) -> None:
    model = pin.buildModelFromXML(urdf)
    pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION, mesh_loader=LOADER)


def why_not_drawn(path: Path) -> str:
    """
    Say why a mesh cannot be seen in a picture.

    It is not read for that, which takes long; what is cut off or something else is found.

    Args:
        path: its file.

    Returns:
        The reason; empty where it is likely to be drawn.

    """
    kind = path.suffix.lower()
    if kind not in DRAWN:
        return f'not one of {", ".join(DRAWN)}'
    data = path.read_bytes()
    head, tail = data[:ENDS].lower(), data[-ENDS:].lower()
    if kind == '.dae':
        whole = b'</collada>' in tail
    elif kind == '.obj':
        whole = all(re.search(rb'^\s*%s\s' % key, data, re.MULTILINE) for key in (b'v', b'f'))
    else:
        facets = int.from_bytes(data[:STL_HEAD][-4:], 'little')
        binary = facets > 0 and STL_HEAD + STL_FACET * facets <= len(data)
        whole = binary or (b'facet' in head and b'end' in tail)
    return '' if whole else f'no whole {kind} file'
