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

"""Installed versions of the libraries that this package uses."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

LIBRARIES = ('numpy', 'scipy', 'pin', 'daqp', 'ruckig', 'pybullet', 'pybullet-arm64', 'mcap')
"""Distributions on which the results of a run depend."""


def installed_versions(libraries: Iterable[str]) -> dict[str, str]:
    """
    Look up versions.

    Args:
        libraries: names of distributions.

    Returns:
        Name to version, of those that Python knows: a system's ROS has some libraries
        without metadata.

    """
    found = {}
    for library in libraries:
        with suppress(PackageNotFoundError):
            found[library] = version(library)
    return found
