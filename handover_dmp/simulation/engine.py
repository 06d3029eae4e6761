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

"""The functions of PyBullet for one of its worlds."""

from __future__ import annotations

from functools import partial
from typing import Any

from handover_dmp.common.closing import Closing
from handover_dmp.common.errors import DataError
from handover_dmp.common.quiet_pybullet import pybullet, silenced


class Engine(Closing):
    """
    A new world of PyBullet: `engine.f(…)` calls `pybullet.f(…)` in this world.

    Use it as a context manager or call `close`; otherwise PyBullet keeps the world.

    Attributes:
        client: PyBullet's number of the world; -1 once it is closed.

    """

    def __init__(self) -> None:
        """
        Make an empty world.

        Raises:
            DataError: PyBullet has too many worlds.

        """
        with silenced():
            self.client = int(pybullet.connect(pybullet.DIRECT))
        if self.client < 0:
            raise DataError('PyBullet cannot create another world: close some first')

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pybullet, name), physicsClientId=self.client)

    def close(self) -> None:
        """Delete the world from PyBullet; a second call does nothing."""
        client, self.client = self.client, -1
        if client >= 0:
            pybullet.disconnect(physicsClientId=client)
