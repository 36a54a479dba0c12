# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Machine code: read where it was copied to, kept where that can be written, whole or anew."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest
from rigid_gns_core.kernels import machine_code

ROOT = Path(__file__).resolve().parents[2]
JIT = """
from pathlib import Path
from rigid_gns_core.kernels.machine_code import MachineCode

CODE = MachineCode('tiny', Path(__file__).parent)
"""
SUMS = """
from .jit import CODE

@CODE.of
def double(value):
    return 2 * value
"""
MAIN = """
import sys
from .sums import CODE, double

with CODE.compiling('the example', 'a moment'):
    made = double(2), double(1.5)
    if 'stop' in sys.argv:
        sys.exit('stopped')
print(*made, sum(double.stats.cache_hits.values()))
"""
PARTS = """
from .jit import CODE

@CODE.part
def square(value):
    return value * value

@CODE.part
def power(value, exponent):
    power = 1
    for _ in range(exponent):
        power *= value
    return square(power) - square(power) + power

@CODE.of
def cube(value):
    return power(value, 3) + square(value) - square(value)

@CODE.of
def cubes(value, count):
    return cube(value) * power(count, 1)
"""
USER = """
import sys, numba
from . import parts

@numba.njit
def fourth(value):
    return parts.power(value, 4)

print(*(getattr(parts, name)(*numbers) for name, numbers in
        (('cube', (2,)), ('cubes', (3, 2)), ('cube', (0.5,)))), fourth(2))
for name in ('square', 'power', 'cube', 'cubes'):
    made = getattr(parts, name)
    print(name, len(made.signatures), sum(made.stats.cache_hits.values()))
"""
NOWHERE = '/dev/null/home'  # not even root can make it
COMPILED, READ = '4 3.0 0\n', '4 3.0 2\n'
TOLD = 'rigid_gns: compiling the example, once; a moment\n'


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Folder of the package `tiny`, which has one compiled function."""
    package = tmp_path / 'place' / 'tiny'
    package.mkdir(parents=True)
    for name, text in (('__init__', ''), ('jit', JIT), ('sums', SUMS), ('__main__', MAIN)):
        (package / f'{name}.py').write_text(text)
    return package.parent


def start(place: Path, *words: str, **changes: str) -> subprocess.Popen[str]:
    environment = {**os.environ, 'PYTHONPATH': f'{place}{os.pathsep}{ROOT}', 'HOME': NOWHERE}
    for name in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME'):
        environment.pop(name, None)
    return subprocess.Popen(
        [sys.executable, '-B', '-m', 'tiny', *words],
        cwd='/',
        env={**environment, **changes},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(place: Path, *words: str, **changes: str) -> tuple[str, str]:
    return start(place, *words, **changes).communicate(timeout=120)


def kept(folder: Path) -> dict[Path, bytes]:
    """Files of machine code; to be compared."""
    return {
        path: path.read_bytes()
        for path in folder.rglob('tiny-*/*/*')
        if path.suffix == '.nbc' or path.name == 'complete'
    }


def bar(place: Path) -> None:
    """Let nothing be written beside the sources, by root neither."""
    (place / 'tiny' / '__pycache__').write_text('')


def test_code_is_read_where_it_was_copied_to(place: Path, tmp_path: Path) -> None:
    """As from a build to an installation, which cannot be written: another folder, other times."""
    assert run(place) == (COMPILED, TOLD)
    before = kept(place)
    assert len(before) == 3  # one a signature, and the mark
    installed = tmp_path / 'installed'
    shutil.copytree(place, installed, copy_function=shutil.copy)
    shutil.rmtree(place)
    assert run(installed) == (READ, '')
    assert list(kept(installed).values()) == list(before.values())


def test_code_that_was_copied_in_part_is_compiled_with_a_word(place: Path) -> None:
    """The mark alone, as after a copy that was cut off, does not say that all is compiled."""
    run(place)
    lost = next(path for path in kept(place) if path.suffix == '.nbc')
    lost.unlink()
    assert run(place) == ('4 3.0 1\n', TOLD)
    assert run(place) == (READ, '')


@pytest.mark.parametrize('variable', ['NUMBA_CACHE_DIR', 'XDG_CACHE_HOME', 'HOME'])
def test_code_is_kept_where_the_user_says(variable: str, place: Path, tmp_path: Path) -> None:
    if variable != 'NUMBA_CACHE_DIR':  # which is chosen even where there is another
        bar(place)
    chosen = {variable: str(tmp_path / 'chosen')}
    assert run(place, **chosen) == (COMPILED, TOLD)
    assert not kept(place) and len(kept(tmp_path / 'chosen')) == 3
    assert run(place, **chosen) == (READ, '')


def test_installed_code_is_read_whatever_the_user_chooses(place: Path, tmp_path: Path) -> None:
    run(place)
    assert run(place, NUMBA_CACHE_DIR=str(tmp_path / 'chosen')) == (READ, '')
    assert not (tmp_path / 'chosen').exists()


def test_without_a_writable_folder_a_line_says_what_to_set(place: Path) -> None:
    bar(place)
    for _ in range(2):
        output, errors = run(place)
        assert output == COMPILED
        told, advice = errors.splitlines(keepends=True)
        assert told == TOLD
        assert f'{NOWHERE}/.cache/rigid_gns cannot be written' in advice
        assert 'set NUMBA_CACHE_DIR' in advice


def test_a_user_without_a_home_has_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> Path:
        raise RuntimeError('Could not determine home directory.')

    for name in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(machine_code.numba.config, 'CACHE_DIR', '')
    monkeypatch.setattr(machine_code.Path, 'home', fail)
    assert machine_code._users_folder() == []


@pytest.mark.parametrize('damage', ['empty', 'cut', 'other bytes'])
def test_damaged_code_is_compiled_anew(damage: str, place: Path) -> None:
    run(place)
    before = kept(place)
    path = next(path for path in before if path.suffix == '.nbc')
    content = before[path]
    middle = len(content) // 2
    damaged = {
        'empty': b'',
        'cut': content[:middle],
        'other bytes': content[:middle] + b'\0\1\2\3' + content[middle + 4 :],
    }
    path.write_bytes(damaged[damage])
    assert run(place) == ('4 3.0 1\n', f'rigid_gns: {path} is damaged: compiled anew\n')
    assert run(place) == (READ, '')


def test_processes_that_compile_at_once_do_no_harm(place: Path) -> None:
    processes = [start(place) for _ in range(4)]
    for process in processes:
        output, errors = process.communicate(timeout=120)
        assert output.startswith('4 3.0 ') and 'damaged' not in errors and process.returncode == 0
    assert run(place) == (READ, '')
    (folder,) = {path.parent for path in kept(place)}
    assert len(list(folder.iterdir())) == 3  # nothing half done is left


def test_code_is_complete_only_when_its_first_use_is_over(place: Path) -> None:
    run(place, 'stop')
    assert len(kept(place)) == 2
    assert run(place) == (READ, TOLD)
    assert run(place) == (READ, '')


def test_an_entry_holds_its_parts_and_others_can_call_them(place: Path) -> None:
    """Parts in parts, entries in entries and in functions of Numba's own, anew and from files.

    A constant integer makes no function of its own of what it is given to.
    """
    tiny = place / 'tiny'
    (tiny / 'parts.py').write_text(PARTS)
    (tiny / '__main__.py').write_text(USER)
    numbers = '8 54 0.125 16\n'
    compiled, errors = run(place)
    assert compiled == numbers + 'square 2 0\npower 2 0\ncube 2 0\ncubes 1 0\n', errors
    for path in kept(place):  # the entries anew, of parts and an entry from files
        if 'parts.cubes' in path.name:
            path.unlink()
    assert run(place)[0] == numbers + 'square 1 1\npower 1 1\ncube 2 2\ncubes 1 0\n'
    assert run(place)[0] == numbers + 'square 1 1\npower 1 1\ncube 2 2\ncubes 1 1\n'
    next(path for path in kept(place) if 'parts.square' in path.name).unlink()
    assert run(place)[0].startswith(numbers)  # what calls it, too


def test_changed_sources_are_compiled_anew(place: Path) -> None:
    run(place)
    sums = place / 'tiny' / 'sums.py'
    sums.write_text(sums.read_text().replace('2 * value', 'value + value'))
    before = kept(place)
    assert run(place) == (COMPILED, TOLD)
    assert len(kept(place)) == 3 and not before.keys() & kept(place).keys()


@pytest.mark.parametrize(
    ('name', 'value', 'remedy'),
    [
        ('NUMBA_DISABLE_JIT', '1', 'the engine runs compiled only: unset it'),
        ('NUMBA_NUM_THREADS', '0', "NUMBA_NUM_THREADS is '0', expected 1 or more; unset it"),
    ],
)
def test_a_numba_that_cannot_compile_is_one_line(
    name: str, value: str, remedy: str, tmp_path: Path
) -> None:
    words = ('rollout', '--scene', 'box_154', '--steps', '1', '--out', str(tmp_path / 'out.h5'))
    done = subprocess.run(
        [sys.executable, '-m', 'rigid_gns_core.commands.cli', *words],
        env={**os.environ, name: value},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2 and remedy in done.stderr and done.stderr.count('\n') == 1
