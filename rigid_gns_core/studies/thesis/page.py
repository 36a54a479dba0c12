# Copyright 2026 rigid_gns maintainers
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

"""Fills the tables of docs/thesis.md from the results, between markers that name an experiment."""

from __future__ import annotations

import os
from pathlib import Path
import re

from .study import shipped_experiments
from .text import format_table
from ...files.config import ConfigError
from ...files.strict_json import read_json

_BLOCK = re.compile(r'(<!-- experiment: (\w+) -->\n)(.*?)(<!-- end -->)', re.DOTALL)


def write_page(page: Path, results: Path) -> None:
    """Replace what is between `<!-- experiment: NAME -->` and `<!-- end -->` by table and figure.

    Args:
        page: Markdown file; all else in it stays.
        results: Folder of a budget's tables.

    Raises:
        ConfigError: A marker names no experiment; the allowed ones are listed.
    """
    known = shipped_experiments()

    def fill(match: re.Match[str]) -> str:
        name = match[2]
        if name not in known:
            raise ConfigError(f'{page}: no experiment {name!r}, allowed: {", ".join(known)}')
        return f'{match[1]}{_content(name, page, results)}{match[4]}'

    text = _BLOCK.sub(fill, page.read_text(encoding='utf-8'))
    page.write_text(text, encoding='utf-8')


def _content(name: str, page: Path, results: Path) -> str:
    path = results / f'{name}.json'
    if not path.is_file():
        return f'\nNot run yet: `rigid-gns experiment {name} --budget {results.name}`.\n\n'
    table = read_json(path)
    content = f'\nBudget {table["budget"]["words"]}.\n\n{format_table(table)}\n'
    figure = path.with_suffix('.png')
    if figure.is_file():
        link = Path(os.path.relpath(figure, page.parent)).as_posix()
        content += f'![{table["title"]}]({link})\n\n'
    return content
