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
