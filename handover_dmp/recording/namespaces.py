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

"""The graph of a bag; a bag may contain several, each in its own namespace."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from handover_dmp.common.errors import DataError
from handover_dmp.recording.bag_reader import bag_information
from handover_dmp.topics import Topic


def recorded_namespace(
    path: Path | str, topics: Sequence[Topic], namespace: str | None = None
) -> str:
    """
    Find the namespace of the graph in a bag.

    Args:
        path: a file or the folder of a bag, or the folder of a run with its bag in `bag/`.
        topics: topics on which the graph must have messages.
        namespace: namespace of the graph if there are several; None: the only one.

    Returns:
        The namespace, `/` for the root, also if there is no such graph.

    Raises:
        DataError: the bag is missing or damaged, or none of several graphs is chosen, or the
            chosen one is missing.

    """
    recorded = {name for name, topic in bag_information(path).topics.items() if topic.count}
    ends = {name.removesuffix(topics[0].name) or '/' for name in recorded}
    graphs = [end for end in sorted(ends) if {t.within(end) for t in topics} <= recorded]
    if namespace is not None:
        wanted = f'/{namespace.strip("/")}'
        if wanted not in graphs:
            there = ', '.join(graphs) or 'none'
            raise DataError(f'{path}: no graph in namespace {wanted}; those in it are: {there}')
        return wanted
    if len(graphs) > 1:
        raise DataError(
            f'{path}: holds several graphs, {" and ".join(graphs)}: '
            'choose one by its namespace or by its topics'
        )
    return graphs[0] if graphs else '/'
