# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What no linter here reads: YAML, XML, JSON are well formed, text is tidy, code has its licence.

Prints one line per finding and exits with 1 where there is one.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
import json
from pathlib import Path
import sys
from xml.etree import ElementTree

import yaml

ROOT = Path(__file__).resolve().parent.parent
SKIPPED = {'.git', 'build', 'install', 'log', 'dist', 'runs', 'bags', 'demo', 'data'}
LARGEST = 10e6  # bytes; what is larger does not belong into a package
TEXT = {'.py', '.yaml', '.yml', '.xml', '.json', '.md', '.rst', '.toml', '.cfg', '.txt'}

# As above, in every source that is not empty.
HEADER = Path(__file__).read_text(encoding='utf-8').partition('\n\n')[0] + '\n'

PARSERS: dict[str, Callable[[str], object]] = {
    '.yaml': lambda text: list(yaml.safe_load_all(text)),
    '.yml': lambda text: list(yaml.safe_load_all(text)),
    '.xml': ElementTree.fromstring,
    '.json': json.loads,
    '.py': ast.parse,
}


def files() -> Iterator[Path]:
    """Files of the source tree, hidden folders of tools left out."""
    for path in sorted(ROOT.rglob('*')):
        parts = path.relative_to(ROOT).parts
        made = (
            parts[0] in SKIPPED
            or parts[0].startswith('.venv')
            or parts[:2] == ('tests', 'corpus')  # damaged on purpose
            or any(part.endswith(('_cache', '__pycache__', '.egg-info')) for part in parts)
        )
        if path.is_file() and not made:
            yield path


def findings(path: Path) -> Iterator[str]:
    """Yield what is wrong with one file."""
    if path.stat().st_size > LARGEST:
        yield f'{path.stat().st_size / 1e6:.0f} MB, more than {LARGEST / 1e6:.0f} MB'
    if path.suffix not in TEXT and path.name not in ('Makefile', 'requirements.lock', 'LICENSE'):
        return
    text = path.read_text(encoding='utf-8')
    if text and not text.endswith('\n'):
        yield 'no newline at the end'
    if path.suffix == '.py' and text and not text.startswith(HEADER):
        yield 'does not begin with the licence header; copy it from .ci/check_files.py'
    for number, line in enumerate(text.splitlines(), 1):
        if line != line.rstrip():
            yield f'line {number}: trailing white space'
        if line.startswith(('<<<<<<< ', '>>>>>>> ')):
            yield f'line {number}: merge marker'
    try:
        PARSERS.get(path.suffix, len)(text)
    except (ValueError, SyntaxError, yaml.YAMLError) as error:
        yield f'not well formed: {error}'


if __name__ == '__main__':
    found = [f'{path.relative_to(ROOT)}: {text}' for path in files() for text in findings(path)]
    print('\n'.join(found) or 'files: all well formed')
    sys.exit(bool(found))
