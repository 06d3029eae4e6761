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
How the human partner stands, bends or lies: the three postures of the paper's Fig. 2.

A stance is all of the body but the arm that acts. Angles are those of the joints of
`human_description`, axes as the International Society of Biomechanics has them: x forward, y up,
z to the right, of a person who stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi


@dataclass(frozen=True, eq=False)
class Stance:
    """
    How the body is while one arm acts.

    Attributes:
        name: in a word.
        joints: of the body that differ from zero, rad, by their names.
        arm_at_ease: (8,), where the acting arm would rather be, rad.
        fingers: (3,), where the fingers of the acting hand would rather point: towards the
            partner, up and to the right of that.
        pitch: of the pelvis, forward, rad; −π/2 lies on the back.
        turn: from the direction to the partner to that in which the body faces, rad, to the left;
            of one who lies, to that in which the feet are.
        hand_over_shoulder_m: lowest and highest at which such a body hands over, m; where the
            exchange is between them, the floor is at z = 0.

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
    # At ease: the arm that does not act a little off the body, eyes down to the hands.
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
    # On the back, the knees up, the left hand at what is above.
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
    # Under the lift: the left hand holds what is above, the eyes are on it.
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
"""By configuration; in any other the partner stands upright."""


def stance_of(configuration: str) -> Stance:
    """
    Tell how the partner is in a configuration.

    Args:
        configuration: its name, as in the column of a data set.

    Returns:
        The stance; upright where the configuration is not known.

    """
    return STANCES.get(configuration, UPRIGHT)
