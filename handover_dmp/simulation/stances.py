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
Stances of the human partner: standing, bent, lying, as in the paper's Fig. 2.

A stance is the posture of the body without the acting arm. Angles are those of the joints of
`human_description`. Axes follow the convention of the International Society of Biomechanics: x
forward, y up, z to the right, for a standing person.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi


@dataclass(frozen=True, eq=False)
class Stance:
    """
    Posture of the body while one arm acts.

    Attributes:
        name: its name, one word.
        joints: joint angles of the body that differ from zero, rad, by name.
        arm_at_ease: (8,), relaxed configuration of the acting arm, rad.
        fingers: (3,), preferred direction of the fingers of the acting hand, in axes towards the
            partner, up, and to the right of that.
        pitch: forward pitch of the pelvis, rad; −π/2: lying on the back.
        turn: angle from the direction to the partner to that in which the body faces, rad, to the
            left; for a lying person, to the direction of the feet.
        hand_over_shoulder_m: lowest and highest position of the hand over the shoulder at an
            exchange, m; if the exchange is between them, the floor is at z = 0.

    """

    name: str
    joints: Mapping[str, float]
    arm_at_ease: tuple[float, ...] = (0.0, 0.55, 0.22, 0.0, 1.15, 0.0, 0.0, 0.0)
    fingers: tuple[float, float, float] = (1.0, 0.15, 0.0)
    pitch: float = 0.0
    turn: float = 0.0
    hand_over_shoulder_m: tuple[float, float] = (-0.55, 0.1)


UPRIGHT = Stance(
    'upright',
    # Relaxed: the other arm slightly away from the body, the eyes down to the hands.
    {
        'left_shoulder_X': 0.10,
        'left_elbow_Z': 0.25,
        'left_hip_X': 0.05,
        'left_ankle_X': 0.05,
        'right_hip_X': 0.05,
        'right_ankle_X': 0.05,
        'middle_cervical_Z': 0.25,
    },
)
LYING = Stance(
    'lying',
    # On the back, the knees up, the left hand at the work above.
    {
        'left_hip_Z': 0.80,
        'left_knee_Z': 1.895,
        'left_ankle_Z': -0.476,
        'right_hip_Z': 0.55,
        'right_knee_Z': 1.32,
        'right_ankle_Z': -0.80,
        'left_shoulder_Z': 0.9,
        'left_shoulder_X': 0.35,
        'left_elbow_Z': 1.3,
        'middle_cervical_Z': 0.35,
    },
    arm_at_ease=(0.0, 0.3, 1.1, 0.0, 0.9, 0.0, 0.0, 0.0),
    fingers=(1.0, 0.25, 0.0),
    pitch=-pi / 2,
    turn=1.15,
    hand_over_shoulder_m=(-0.15, 0.6),
)
BENT = Stance(
    'bent',
    # Over the edge of the engine bay, on which the left hand leans.
    {
        'middle_lumbar_Z': 0.40,
        'middle_thoracic_Z': 0.25,
        'middle_cervical_Z': -0.20,
        'left_hip_Z': 0.50,
        'left_knee_Z': 0.15,
        'left_ankle_Z': 0.15,
        'left_hip_X': 0.08,
        'left_ankle_X': 0.08,
        'right_hip_Z': 0.40,
        'right_knee_Z': 0.06,
        'right_ankle_Z': 0.16,
        'right_hip_X': 0.08,
        'right_ankle_X': 0.08,
        'left_shoulder_Z': 1.35,
        'left_shoulder_X': 0.2,
        'left_elbow_Z': 0.5,
    },
    arm_at_ease=(0.0, 0.9, 0.7, 0.0, 0.8, 0.0, 0.0, 0.0),
    fingers=(1.0, 0.0, 0.0),
    pitch=0.50,
    turn=0.9,
    hand_over_shoulder_m=(-0.6, 0.25),
)
RAISED = Stance(
    'raised',
    # Under the lift: the left hand holds the work above, the eyes are on it.
    {
        'left_shoulder_Z': 2.55,
        'left_shoulder_X': 0.15,
        'left_elbow_Z': 0.75,
        'middle_thoracic_Z': -0.08,
        'middle_cervical_Z': -0.35,
        'left_hip_X': 0.08,
        'left_ankle_X': 0.08,
        'right_hip_X': 0.08,
        'right_ankle_X': 0.08,
    },
    arm_at_ease=(0.0, 1.4, 0.3, 0.0, 0.9, 0.0, 0.0, 0.0),
    fingers=(1.0, 0.5, 0.0),
    hand_over_shoulder_m=(-0.3, 0.6),
)

STANCES: Mapping[str, Stance] = {
    'under_car': LYING,
    'engine_bay': BENT,
    'hydraulic_lift': RAISED,
}
"""Stance by configuration; in any other configuration the partner stands upright."""


def stance_of(configuration: str) -> Stance:
    """
    Return the stance of the partner in a configuration.

    Args:
        configuration: its name, as in the column of a data set.

    Returns:
        The stance; upright if the configuration is unknown.

    """
    return STANCES.get(configuration, UPRIGHT)
