# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message packages that are not installed, made of their definitions by ROS' generators and gcc.

No wheel has them, and most robots do. Field lists are in `definitions/`.
"""

from __future__ import annotations

import ctypes
import importlib
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
from typing import Any

import numpy as np
import pytest

DEFINITIONS = Path(__file__).with_name('definitions')  # <package>/msg/<Type>.msg
_SUPPORTS = ('rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c')
_NEEDED = ('builtin_interfaces', 'std_msgs', 'geometry_msgs')


def message_package(name: str, folder: Path) -> Any:
    """Module `<name>.msg`: the installed one, else one that is made in `folder`."""
    try:
        return importlib.import_module(f'{name}.msg')
    except ImportError:
        _make(name, folder)
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    return importlib.import_module(f'{name}.msg')


def _make(name: str, folder: Path) -> None:
    compiler = shutil.which('gcc')
    if compiler is None or not Path(sysconfig.get_path('include'), 'Python.h').is_file():
        pytest.skip(f'{name} is not installed, and nothing to compile it with is')
    root = folder / name
    _generate(name, root)
    (root / '__init__.py').touch()
    prefix = Path(sys.prefix)
    headers = [
        *(prefix / 'include', *(prefix / 'include').iterdir()),
        *(folder, sysconfig.get_path('include'), np.get_include()),
    ]
    libraries = ['rosidl_runtime_c', 'rosidl_typesupport_c', *_SUPPORTS]
    libraries += ['rosidl_typesupport_fastrtps_cpp', 'fastcdr']
    for needed in _NEEDED:
        kinds = ('rosidl_generator_c', 'rosidl_generator_py', *_SUPPORTS)
        libraries += [f'{needed}__{kind}' for kind in kinds]
    made = root / f'{name}_s__rosidl_typesupport_c.so'
    subprocess.run(
        [
            *(compiler, '-shared', '-fPIC', '-O0', '-w'),
            *('-o', str(made), f'-Wl,-soname,{made.name}'),
            *sorted(str(path) for kind in ('*.c', '*.cpp') for path in root.rglob(kind)),
            *(f'-I{path}' for path in headers),
            f'-L{prefix / "lib"}',
            f'-Wl,-rpath,{prefix / "lib"}',
            *(f'-l:lib{library}.so' for library in libraries),
            '-lstdc++',
        ],
        check=True,
        cwd=folder,
    )
    for support in _SUPPORTS:  # ROS opens them by these names: loaded once, they are found
        library = folder / f'lib{name}__{support}.so'
        subprocess.run(
            [
                *(compiler, '-shared', '-o', str(library), f'-Wl,-soname,{library.name}'),
                *('-Wl,--no-as-needed', str(made), f'-Wl,-rpath,{root}'),
            ],
            check=True,
        )
        ctypes.CDLL(str(library))


def _generate(name: str, root: Path) -> None:
    """Sources of the Python module and of the type support of Fast DDS."""
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    files = [
        f'{DEFINITIONS / name}:msg/{path.name}' for path in (DEFINITIONS / name).rglob('*.msg')
    ]
    known = [str(Path(sys.prefix, 'share'))]
    root.mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('AMENT_PREFIX_PATH', sys.prefix)
        for generator in (
            GenerateC('c'),
            GenerateFastRTPSCTypesupport('fastrtps'),
            GenerateIntrospectionCTypesupport('introspection'),
            GenerateCTypesupport('support', typesupport_implementations=list(_SUPPORTS)),
            GeneratePython('py', typesupport_implementations=['rosidl_typesupport_c']),
        ):
            generator.generate(name, list(files), known, root)
