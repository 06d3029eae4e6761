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
One thread for linear algebra.

The matrices here are small: a second thread costs more than it gains, and on a busy machine a
hundred times more. Call this before numpy is imported.
"""

from __future__ import annotations

import os

VARIABLES = ('OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'OMP_NUM_THREADS')


def use_one_thread() -> None:
    """Limit the linear algebra libraries to one thread, unless the user has set another number."""
    for variable in VARIABLES:
        os.environ.setdefault(variable, '1')
