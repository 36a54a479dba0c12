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

"""Resolve the extra `all` of setup.py with pip and write requirements.lock: exact versions.

Arguments are handed to pip. Run with Python 3.11, the version with the most wheels: what exists
only there keeps the marker that setup.py gives it.
"""

from __future__ import annotations

import json
from pathlib import Path
import re
import subprocess
import sys
import tempfile

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / 'requirements.lock'
# Chosen by hand: this torch is what the shipped weights were tried with, and newer ones are only
# there with CUDA; 79 is the last setuptools that colcon accepts.
CHOSEN = ['torch==2.13.0', 'setuptools==79.0.1']
HEADER = """\
# Exact versions of everything that make installs, for Python 3.11 and 3.12.
# Made by `make lock` from setup.py; do not edit.
"""


def resolve(options: list[str]) -> list[dict]:
    """Distributions that pip would install into an empty environment."""
    with tempfile.NamedTemporaryFile(suffix='.json') as report:
        subprocess.run(
            [
                sys.executable,
                '-m',
                'pip',
                'install',
                '-qq',
                '--dry-run',
                '--ignore-installed',
                '--report',
                report.name,
                *options,
                *CHOSEN,
                f'{ROOT}[all]',
            ],
            check=True,
        )
        return json.loads(Path(report.name).read_text(encoding='utf-8'))['install']


def canonical(name: str) -> str:
    """Name as PEP 503 compares it."""
    return re.sub(r'[-_.]+', '-', name).lower()


def lines(distributions: list[dict]) -> list[str]:
    """One requirement per distribution, without this package and without local build labels."""
    markers: dict[str, str] = {}
    versions: dict[str, str] = {}
    for metadata in (distribution['metadata'] for distribution in distributions):
        if metadata['name'] != 'rigid_gns_ros':
            versions[canonical(metadata['name'])] = metadata['version'].split('+')[0]
            continue
        for requirement in metadata['requires_dist']:
            name = canonical(re.match(r'[\w.-]+', requirement)[0])
            if marker := re.search(r'python_version\s*[<>=]+\s*"[\d.]+"', requirement):
                markers[name] = f' ; {marker[0]}'
    if cuda := [name for name in versions if name.startswith(('nvidia-', 'triton', 'cuda-'))]:
        sys.exit(
            f'lock: {cuda[0]} came in: pip found a CUDA build of torch; point it at a CPU build '
            "with PIP_FLAGS='--extra-index-url https://download.pytorch.org/whl/cpu'"
        )
    return [f'{name}=={versions[name]}{markers.get(name, "")}' for name in sorted(versions)]


if __name__ == '__main__':
    if sys.version_info[:2] != (3, 11):
        sys.exit(
            f'lock: this is Python {sys.version.split()[0]}, expected 3.11: '
            'make lock PYTHON=python3.11'
        )
    content = lines(resolve(sys.argv[1:]))
    LOCK.write_text(HEADER + '\n'.join(content) + '\n', encoding='utf-8')
    print(f'lock: {len(content)} distributions in {LOCK.name}')
