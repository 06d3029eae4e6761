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

"""Search for packages and meshes of a robot description: `package://`, relative, `file://`."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

LOOKED_IN = 'looked in AMENT_PREFIX_PATH, ROS_PACKAGE_PATH and beside the file'
LFS_POINTER = b'version https://git-lfs'
"""First bytes of a file that Git LFS has not fetched yet."""


def find_package(name: str, folder: Path | None) -> Path | None:
    """
    Find the folder of a ROS package, in the same folders as its meshes.

    Args:
        name: name of the package.
        folder: folder of the description; None if it did not come from a file.

    Returns:
        The absolute path; None if there is no such package.

    """
    for candidate in _package_folders(name, folder):
        if candidate.is_dir():
            return candidate.resolve()
    return None


def find_mesh(name: str, folder: Path | None) -> Path | None:
    """
    Find the file of a mesh.

    `package://NAME/REST` is searched in the prefixes of `AMENT_PREFIX_PATH`, in the folders of
    `ROS_PACKAGE_PATH`, and in the folder of the description and those above it, which may contain
    the package or be the package. Relative paths are resolved from the same folders.

    Args:
        name: name in the description.
        folder: folder of the description; None if it did not come from a file.

    Returns:
        The absolute path; None if there is no such file.

    """
    scheme, separator, rest = name.partition('://')
    if not separator:
        scheme, rest = '', name
    if scheme in ('package', 'model'):
        package, _, inner = rest.partition('/')
        folders = _package_folders(package, folder)
        candidates: Iterator[Path] = (place / inner for place in folders)
    elif scheme in ('', 'file'):
        candidates = _by_path(rest, folder)
    else:
        return None
    for candidate in candidates:
        for path in (candidate, candidate.parent / unquote(candidate.name)):
            if path.is_file() and not _is_pointer(path):
                return path.resolve()
    return None


def _by_path(path: str, folder: Path | None) -> Iterator[Path]:
    if Path(path).is_absolute():
        yield Path(path)
    elif folder is not None:
        yield from (above / path for above in _folders(folder))


def _package_folders(package: str, folder: Path | None) -> Iterator[Path]:
    for prefix in _listed('AMENT_PREFIX_PATH'):
        yield prefix / 'share' / package
    for root in _listed('ROS_PACKAGE_PATH'):
        yield root / package
        if package in (root.name, _package_name(root)):
            yield root
    for above in _folders(folder) if folder is not None else ():
        if package in (above.name, _package_name(above)):
            yield above
        yield above / package
        yield above / 'share' / package


def _folders(folder: Path) -> tuple[Path, ...]:
    """Return a folder and those above it."""
    folder = folder.resolve()
    return folder, *folder.parents


def _listed(variable: str) -> Iterator[Path]:
    for folder in os.environ.get(variable, '').split(os.pathsep):
        if folder:
            yield Path(folder)


def _package_name(folder: Path) -> str:
    """Return the package name in the `package.xml` of a folder; the folder name may differ."""
    try:
        return (ElementTree.parse(folder / 'package.xml').findtext('name') or '').strip()
    except (OSError, ElementTree.ParseError):
        return ''


def _is_pointer(path: Path) -> bool:
    with path.open('rb') as file:
        return file.read(len(LFS_POINTER)) == LFS_POINTER
