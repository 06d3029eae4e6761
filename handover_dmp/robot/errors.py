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

"""Errors of arms and of their tasks."""

from __future__ import annotations

from handover_dmp.common.errors import DataError


class RobotDescriptionError(DataError):
    """A robot description cannot be used; the message names the file and the fault."""


class UnreachableError(DataError):
    """
    A wrist pose, or a path, that the arm cannot reach.

    Attributes:
        missing_m: distance from the requested point to the nearest reachable one, m; infinite for
            a path that the arm could not follow even if it were smaller.

    """

    def __init__(self, message: str, missing_m: float) -> None:
        super().__init__(message)
        self.missing_m = missing_m
