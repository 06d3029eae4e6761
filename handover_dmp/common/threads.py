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

The matrices here are small: a second thread costs more than it brings, and on a busy machine it
costs a hundred times more. To be called before numpy is imported.
"""

from __future__ import annotations

import os

VARIABLES = ('OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'OMP_NUM_THREADS')


def use_one_thread() -> None:
    """Tell the linear algebra libraries, unless the user has told them something else."""
    for variable in VARIABLES:
        os.environ.setdefault(variable, '1')
