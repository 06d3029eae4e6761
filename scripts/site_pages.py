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
Pages of the site besides those of `docs/`: the README, and a reference page for each room.

This is a hook of mkdocs, named in `mkdocs.yml` and run by `make docs`.
"""

from __future__ import annotations

import ast
from pathlib import Path
import re

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'handover_dmp'
LINK = re.compile(r'(!?)\[([^\]]*)\]\((?!https?:|#)([^)\s]+)\)')


def rooms() -> dict[str, str]:
    """
    List the rooms of the package.

    Returns:
        Room to the first line of its docstring.

    """
    found = {}
    for file in sorted(PACKAGE.glob('*/__init__.py')):
        docstring = ast.get_docstring(ast.parse(file.read_text(encoding='utf-8')))
        if docstring is None:
            raise ValueError(f'{file} has no docstring')
        found[file.parent.name] = docstring.partition('\n')[0]
    return found


def reference(room: str, meaning: str) -> str:
    """
    Write the reference page of a room.

    Args:
        room: its name.
        meaning: its purpose.

    Returns:
        Markdown with every module of the room, made from its docstrings.

    """
    modules = sorted(file.stem for file in (PACKAGE / room).glob('*.py'))
    parts = [f'::: handover_dmp.{room}.{name}' for name in modules if name != '__init__']
    return '\n\n'.join([f'# {room}', meaning, *parts]) + '\n'


def within_site(markdown: str, folder: Path) -> str:
    """
    Replace links to files of the repository that are not on the site by their names.

    Args:
        markdown: text of a page.
        folder: folder to which its links are relative.

    Returns:
        The text; links to pages and pictures of `docs/` are relative to the site's root.

    """

    def place(link: re.Match[str]) -> str:
        image, text, target = link.groups()
        path, _, anchor = target.partition('#')
        goal = (folder / path).resolve()
        if goal == ROOT / 'README.md':
            goal = ROOT / 'docs' / 'index.md'
        if goal.is_relative_to(ROOT / 'docs'):
            inside = goal.relative_to(ROOT / 'docs').as_posix()
            return f'{image}[{text}]({inside}{"#" + anchor if anchor else ""})'
        name = f'`{goal.relative_to(ROOT).as_posix()}`'
        return name if text.strip('`') == name.strip('`') else f'{text} ({name})'

    return LINK.sub(place, markdown)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """
    Add the pages.

    Args:
        files: files of `docs/`.
        config: configuration of the site.

    Returns:
        All files.

    """
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    files.append(File.generated(config, 'index.md', content=within_site(readme, ROOT)))
    pages: list[str] = []
    for room, meaning in rooms().items():
        page = f'reference/{room}.md'
        files.append(File.generated(config, page, content=reference(room, meaning)))
        pages.append(page)
    assert config.nav is not None
    table = '# topics\n\n::: handover_dmp.topics\n'
    files.append(File.generated(config, 'reference/topics.md', content=table))
    config.nav.append({'Reference': ['reference/topics.md', *pages]})
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """
    Adapt the links of a page to the site.

    Args:
        markdown: text of the page.
        page: the page.
        config: configuration of the site.
        files: all files.

    Returns:
        The text.

    """
    if '/' in page.file.src_uri or page.file.src_uri == 'index.md':
        return markdown
    return within_site(markdown, ROOT / 'docs')
