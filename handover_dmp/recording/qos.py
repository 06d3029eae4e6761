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

"""Quality of service of a recorded topic, in the terms of rosbag2's files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import yaml

INFINITE = (9223372036, 854775807)


@dataclass(frozen=True)
class Qos:
    """
    The profile that one publisher offers.

    The defaults are what rosbag2 gets from a running graph, which does not reveal history and
    depth of a publisher.

    Attributes:
        reliability: `reliable` or `best_effort`.
        durability: `volatile` or `transient_local`.
        history: `keep_last`, `keep_all` or `unknown`.
        depth: queue length of `keep_last`.
        deadline: seconds and nanoseconds.
        lifespan: seconds and nanoseconds.
        liveliness: `automatic` or `manual_by_topic`.
        liveliness_lease_duration: seconds and nanoseconds.

    """

    reliability: str = 'reliable'
    durability: str = 'volatile'
    history: str = 'unknown'
    depth: int = 0
    deadline: tuple[int, int] = INFINITE
    lifespan: tuple[int, int] = INFINITE
    liveliness: str = 'automatic'
    liveliness_lease_duration: tuple[int, int] = INFINITE

    @classmethod
    def from_profile(cls, profile: Any) -> Qos:
        """
        Convert a `rclpy.qos.QoSProfile`.

        Args:
            profile: the profile, e.g. of an entry of `get_publishers_info_by_topic`.

        Returns:
            The profile in the terms of rosbag2.

        """

        def parts(duration: Any) -> tuple[int, int]:
            seconds, nanoseconds = divmod(int(duration.nanoseconds), 10**9)
            return seconds, nanoseconds

        return cls(
            reliability=profile.reliability.name.lower(),
            durability=profile.durability.name.lower(),
            history=profile.history.name.lower(),
            depth=int(profile.depth),
            deadline=parts(profile.deadline),
            lifespan=parts(profile.lifespan),
            liveliness=profile.liveliness.name.lower(),
            liveliness_lease_duration=parts(profile.liveliness_lease_duration),
        )

    def as_rosbag2(self) -> dict[str, Any]:
        """Return the profile in the format of rosbag2's `metadata.yaml`, version 9."""

        def time(duration: tuple[int, int]) -> dict[str, int]:
            return {'sec': duration[0], 'nsec': duration[1]}

        return {
            'history': self.history,
            'depth': self.depth,
            'reliability': self.reliability,
            'durability': self.durability,
            'deadline': time(self.deadline),
            'lifespan': time(self.lifespan),
            'liveliness': self.liveliness,
            'liveliness_lease_duration': time(self.liveliness_lease_duration),
            'avoid_ros_namespace_conventions': False,
        }


SENSOR = Qos(reliability='best_effort')
COMMAND = Qos()
LATCHED = Qos(durability='transient_local')


@cache
def dump_profiles(profiles: tuple[Qos, ...]) -> str:
    """Return the YAML text that rosbag2 stores with each channel."""
    text = yaml.safe_dump([profile.as_rosbag2() for profile in profiles], sort_keys=False)
    return str(text).strip()
