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

"""What several rooms' tests share."""

from __future__ import annotations

from pathlib import Path

from handover_dmp.common.threads import use_one_thread
import pytest

use_one_thread()

KTH = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'kth_handovers'


@pytest.fixture(scope='session')
def kth_folder() -> Path:
    """Folder of the recorded handovers between people; the test skips where it is absent."""
    if not (KTH / 'trials.csv').is_file():
        pytest.skip('recordings of people not available')
    return KTH
