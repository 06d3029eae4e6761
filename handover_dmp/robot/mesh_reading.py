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

"""Checks of mesh files, which may be truncated or of an unsupported format."""

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
"""Formats that can be drawn."""
ENDS = 512
"""Number of bytes at either end of a file that are checked."""
STL_HEAD, STL_FACET = 84, 50
"""Bytes of a binary STL file before its facets, and per facet."""


def why_not_collided(path: Path, scale: Sequence[float]) -> str:
    """
    Return why a mesh cannot be used for collision.

    Args:
        path: file of the mesh.
        scale: three factors.

    Returns:
        The reason; empty if the mesh can be read.

    """
    place = ' '.join(map(repr, map(float, scale)))
    shape = f'<mesh filename="{escape(str(path))}" scale="{place}"/>'
    link = f'<link name="l"><collision><geometry>{shape}</geometry></collision></link>'
    urdf = f'<robot name="r">{link}</robot>'
    try:
        # the loader caches only what Pinocchio makes it read
        with silenced():
            model = pin.buildModelFromXML(urdf)
            pin.buildGeomFromUrdfString(
                model, urdf, pin.GeometryType.COLLISION, mesh_loader=LOADER
            )
    except (ValueError, RuntimeError) as error:
        reason = re.search(r'message: (.*?)(\nHint:|$)', str(error), re.DOTALL)
        words = (reason[1] if reason else str(error)).replace(
            f'Could not load resource {path}', ''
        )
        return ' '.join(words.replace(str(path), path.name).split()).rstrip('.') or 'not a mesh'
    return ''


def why_not_drawn(path: Path) -> str:
    """
    Return why a mesh cannot be drawn.

    The mesh is not loaded, which would be slow; truncated files and other formats are detected.

    Args:
        path: file of the mesh.

    Returns:
        The reason; empty if it can probably be drawn.

    """
    kind = path.suffix.lower()
    if kind not in DRAWN:
        return f'format is not one of {", ".join(DRAWN)}'
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
    return '' if whole else f'incomplete {kind} file'
