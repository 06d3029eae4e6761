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

"""Style of all figures, as settings of matplotlib."""

from __future__ import annotations

from typing import Any

EXCHANGE_COLOUR = '#f3d9a4'
EXCHANGE_TINTS = {'give': '#d6e6f5', 'take': '#fbe3c8'}
PLOT_STYLE: Any = {
    'font.size': 10,
    'font.family': 'DejaVu Sans',
    'axes.titlesize': 10.5,
    'axes.titlelocation': 'left',
    'axes.labelsize': 10,
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.edgecolor': '#59626d',
    'axes.xmargin': 0.01,
    'grid.color': '#eceff2',
    'grid.linewidth': 0.8,
    'xtick.color': '#39424d',
    'ytick.color': '#39424d',
    'legend.frameon': False,
    'figure.facecolor': 'white',
}
