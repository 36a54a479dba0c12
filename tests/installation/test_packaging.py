# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One version everywhere, every file in the wheel, every dependency in the lock."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tomllib
from xml.etree import ElementTree
import zipfile

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (
    'setup.py',
    'setup.cfg',
    'pyproject.toml',
    'package.xml',
    'README.md',
    'LICENSE',
    'resource',
    'config',
    'launch',
    'rigid_gns_core',
    'rigid_gns_ros',
)


def canonical(name: str) -> str:
    return re.sub(r'[-_.]+', '-', name).lower()


def lock() -> dict[str, str]:
    """Name to the rest of its line in the lock."""
    lines = (ROOT / 'requirements.lock').read_text(encoding='utf-8').splitlines()
    entries = [line.split('==', 1) for line in lines if line and not line.startswith('#')]
    return dict(entries)


@pytest.fixture(scope='module')
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """Return the wheel of a copy of the source tree: building leaves files behind.

    Its machine code is copied too, so that it is not compiled anew.
    """
    folder = tmp_path_factory.mktemp('wheel')
    (folder / 'tree').mkdir()
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / 'tree' / name, ignore=shutil.ignore_patterns('*.pyc'))
        else:
            shutil.copy(source, folder / 'tree' / name)
    subprocess.run(
        [
            sys.executable,
            '-m',
            'pip',
            'wheel',
            '--quiet',
            '--no-deps',
            '--no-build-isolation',
            '--wheel-dir',
            str(folder),
            str(folder / 'tree'),
        ],
        check=True,
        capture_output=True,
    )
    (path,) = folder.glob('*.whl')
    return zipfile.ZipFile(path)


def wheel_metadata(wheel: zipfile.ZipFile, name: str) -> str:
    (member,) = (n for n in wheel.namelist() if n.endswith(f'.dist-info/{name}'))
    return wheel.read(member).decode()


def test_one_version(wheel: zipfile.ZipFile) -> None:
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    version = package.findtext('version')
    assert f'\nVersion: {version}\n' in wheel_metadata(wheel, 'METADATA')
    changelog = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    newest = re.search(r'^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)$|^Forthcoming$', changelog, re.M)
    assert newest, 'CHANGELOG.rst has no section'
    assert newest[1] in (None, version)


def test_package_xml_agrees_with_setup(wheel: zipfile.ZipFile) -> None:
    parser = pytest.importorskip('catkin_pkg.package', reason='comes with colcon')
    package = parser.parse_package(str(ROOT / 'package.xml'), warnings=(warnings := []))
    assert not warnings
    text = wheel_metadata(wheel, 'METADATA')
    assert f'\nName: {package.name}\n' in text
    assert f'\nMaintainer-email: {package.maintainers[0].email}\n' in text
    assert package.licenses == ['Apache-2.0']
    assert package.get_build_type() == 'ament_python'


def test_wheel_holds_every_file_of_both_packages(wheel: zipfile.ZipFile) -> None:
    held = set(wheel.namelist())
    for package in ('rigid_gns_core', 'rigid_gns_ros'):
        for path in (ROOT / package).rglob('*'):
            if path.is_file() and '__pycache__' not in path.parts:
                assert path.relative_to(ROOT).as_posix() in held


def test_wheel_holds_the_machine_code(wheel: zipfile.ZipFile) -> None:
    """All of it, in the list of files to be removed again too, and nothing of older sources."""
    record = wheel_metadata(wheel, 'RECORD')
    for folder in (
        'rigid_gns_core/engine/__pycache__/engine',
        'rigid_gns_core/tracking/__pycache__/tracking',
    ):
        held = [name for name in wheel.namelist() if name.startswith(f'{folder}-')]
        assert all(name in record for name in held)
        assert len({name.rsplit('/', 1)[0] for name in held}) == 1
        assert sum(name.endswith('/complete') for name in held) == 1
        assert any(name.endswith('.nbc') for name in held)
    assert not [name for name in wheel.namelist() if name.endswith('.pyc')]


def test_wheel_holds_what_ros_looks_for(wheel: zipfile.ZipFile) -> None:
    shared = {name.split('.data/data/')[1] for name in wheel.namelist() if '.data/data/' in name}
    expected = {
        'share/ament_index/resource_index/packages/rigid_gns_ros',
        'share/rigid_gns_ros/package.xml',
    }
    for folder, pattern in (('config', '*.yaml'), ('launch', '*_launch.py')):
        expected |= {
            f'share/rigid_gns_ros/{path.relative_to(ROOT).as_posix()}'
            for path in (ROOT / folder).rglob(pattern)
        }
    assert expected <= shared
    assert 'tests/conftest.py' not in wheel.namelist()


def test_console_scripts_start(wheel: zipfile.ZipFile) -> None:
    text = wheel_metadata(wheel, 'entry_points.txt')
    scripts = dict(re.findall(r'^([\w-]+) = ([\w.]+:\w+)$', text, re.M))
    assert set(scripts) == {'simulator', 'tracker', 'evaluate', 'rigid-gns'}
    for target in scripts.values():
        module, function = target.split(':')
        path = ROOT / f'{module.replace(".", "/")}.py'
        assert re.search(rf'^def {function}\(', path.read_text(encoding='utf-8'), re.M), target


def test_lock_holds_every_requirement(wheel: zipfile.ZipFile) -> None:
    locked = lock()
    lines = re.findall(r'^Requires-Dist: ([\w.-]+)(.*)$', wheel_metadata(wheel, 'METADATA'), re.M)
    assert {canonical(name) for name, _ in lines} <= set(locked)
    extras = wheel_metadata(wheel, 'METADATA')
    assert re.search(r'pybullet.*python_version < "3.12"', extras)  # no wheel for 3.12
    assert locked['torch'] == '2.13.0'
    assert not [name for name in locked if name.startswith(('nvidia-', 'cuda-', 'triton'))]
    assert int(locked['setuptools'].split('.')[0]) < 80


def test_lock_is_installed() -> None:
    """`make test` installed the lock, which was made for 3.11: what is here has its versions."""
    if not (Path(sys.prefix) / '.complete').exists():
        pytest.skip('this environment was not made by make')
    here = {canonical(found.name): found.version for found in metadata.distributions()}
    wanted = lock() if sys.version_info < (3, 12) else here.keys() & lock().keys()
    assert {name: here[name].split('+')[0] for name in wanted} == {
        name: lock()[name] for name in wanted
    }


def test_editable_install_is_a_ros_prefix() -> None:
    if not (Path(sys.prefix) / '.ready').exists():
        pytest.skip('this environment was not made by make')
    prefix = Path(sys.prefix)
    assert (prefix / 'share/ament_index/resource_index/packages/rigid_gns_ros').is_file()
    assert (prefix / 'share/rigid_gns_ros/package.xml').is_file()
    for name in ('simulator', 'tracker', 'evaluate'):
        assert (prefix / 'lib/rigid_gns_ros' / name).is_file()


def test_pyproject_holds_no_metadata() -> None:
    content = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    assert 'project' not in content  # it would compete with setup.py, which colcon reads
