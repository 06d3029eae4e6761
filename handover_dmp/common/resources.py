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

"""Location of the files that come with the package: `config/`, `urdf/`, `launch/`."""

from __future__ import annotations

from pathlib import Path

PACKAGE = 'handover_dmp'


def share_path(relative: str) -> Path:
    """
    Find a file of the package's share folder.

    In a source tree this folder is the root of the repository. After an install (pip and colcon
    have the same layout) it is `share/handover_dmp` under the prefix of the installation.

    Args:
        relative: path below the share folder, e.g. `urdf/lwr4.urdf`.

    Returns:
        The absolute path.

    Raises:
        FileNotFoundError: the file is in neither place.

    """
    package_folder = Path(__file__).resolve().parents[1]
    source_tree = package_folder.parent
    candidates = [source_tree] if (source_tree / 'package.xml').is_file() else []
    candidates += [prefix / 'share' / PACKAGE for prefix in package_folder.parents]
    for folder in candidates:
        if (folder / relative).exists():
            return folder / relative
    raise FileNotFoundError(f'{relative}: not among the files of {PACKAGE}')
