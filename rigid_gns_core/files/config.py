# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frozen dataclasses from YAML, with errors that name the key and list the allowed ones."""

from __future__ import annotations

from collections.abc import Mapping
import dataclasses
import math
from pathlib import Path
import re
import sys
import types
import typing
from typing import Any, TypeVar

import yaml

from ..errors import shown, UserError

T = TypeVar('T')

# whole numbers beyond are neither counts nor seeds, and NumPy and HDF5 hold none
_LARGEST_INT = 2**63 - 1
# levels of a YAML file; those of scenes and recipes have five
_DEEPEST = 50
# digits that YAML 1.1 reads to the base of 8
_OCTAL = re.compile(r'[-+]?0[0-7_]+')


class ConfigError(UserError):
    """A configuration holds something that cannot be used."""


def from_mapping(cls: type[T], mapping: Mapping[str, Any], where: str = '') -> T:
    """Dataclass `cls` from a mapping; nested dataclasses from nested mappings.

    Args:
        cls: The dataclass.
        mapping: Values of its fields.
        where: Name of the mapping in messages; default: that of the class.

    Raises:
        ConfigError: An unknown key (the allowed ones are listed), a missing key, or a wrong type.
    """
    where = where or cls.__name__
    if not isinstance(mapping, Mapping):
        raise ConfigError(f'{where} is {shown(mapping)}, expected a mapping')
    members = dataclasses.fields(cls)  # type: ignore[arg-type]
    fields = {field.name: field for field in members if field.init}
    if unknown := sorted(set(mapping) - set(fields), key=str):
        raise ConfigError(
            f'{where}: unknown key {shown(unknown[0])}, allowed: {", ".join(fields)}'
        )
    hints = typing.get_type_hints(cls)
    values = {key: _convert(hints[key], value, f'{where}.{key}') for key, value in mapping.items()}
    missing = [
        name
        for name, field in fields.items()
        if name not in values
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    ]
    if missing:
        raise ConfigError(f'{where}: missing key {missing[0]!r}')
    try:
        return cls(**values)
    except UserError as error:
        text = str(error)
        raise ConfigError(text if where in text else f'{where}: {text}') from error


def to_mapping(config: Any) -> dict[str, Any]:
    """Plain mapping of a configuration dataclass; the inverse of `from_mapping`."""
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in dataclasses.asdict(config).items()
    }


class _Loader(yaml.SafeLoader):
    """Loader that stops at a depth: PyYAML's time grows with its square, until Python gives up."""

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose a node within others."""
        if self.depth >= _DEEPEST:
            raise ConfigError(f'it is nested too deeply, expected at most {_DEEPEST} levels')
        self.depth += 1
        try:
            return super().compose_node(parent, index)
        finally:
            self.depth -= 1


class _StrictLoader(_Loader):
    """Loader that refuses what YAML 1.1 takes for something else than is written."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Construct a mapping; PyYAML keeps the last of several values of a key."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value != '<<':
                if key.value in seen:
                    raise ConfigError(
                        f'key {shown(key.value)} is given twice, {_place(key.start_mark)}; '
                        'remove one of them'
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)

    def construct_number(self, node: Any) -> Any:
        """Construct a number: 010 is 8 and 1:30 is 90 in YAML 1.1."""
        read = self.construct_yaml_int if node.tag.endswith(':int') else self.construct_yaml_float
        value = read(node)
        if ':' in node.value or _OCTAL.fullmatch(node.value):
            raise ConfigError(
                f'{node.value} is read as {value:g}, {_place(node.start_mark)}; write it without '
                'colons and leading zeros, or a text in quotes'
            )
        return value


for _kind in ('int', 'float'):
    _StrictLoader.add_constructor(f'tag:yaml.org,2002:{_kind}', _StrictLoader.construct_number)


def _place(mark: yaml.Mark) -> str:
    return f'line {mark.line + 1}, column {mark.column + 1}'


def parse_yaml(text: str, *, strict: bool = True) -> Any:
    """Value of a YAML text.

    Args:
        text: The text.
        strict: Refuse keys that are given twice, and numbers that YAML takes for others.

    Raises:
        ConfigError: It is no YAML, or nested too deeply.
    """
    try:
        return yaml.load(text, Loader=_StrictLoader if strict else _Loader)  # noqa: S506 - safe
    except yaml.MarkedYAMLError as error:
        reason = ', '.join(filter(None, (error.context, error.problem)))
        mark = error.problem_mark or error.context_mark
        where = f', {_place(mark)}' if mark else ''
        raise ConfigError(f'not valid YAML: {" ".join(reason.split())}{where}') from error
    # no text, a date or a number that is none, a key that is a list
    except (yaml.YAMLError, ValueError, TypeError) as error:
        raise ConfigError(f'not valid YAML: {" ".join(str(error).split())}') from error


def load_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML file that holds one mapping; ConfigError where it cannot be read."""
    path = Path(path)
    try:
        content = parse_yaml(path.read_text(encoding='utf-8'))
    except FileNotFoundError:
        raise ConfigError(f'{path}: no such file') from None
    except UnicodeDecodeError as error:
        raise ConfigError(f'{path}: not valid YAML: {error}') from error
    except ConfigError as error:
        raise ConfigError(f'{path}: {error}') from error
    if not isinstance(content, dict):
        raise ConfigError(f'{path}: holds {type(content).__name__}, expected a mapping')
    return content


def config_folder() -> Path:
    """Folder of the shipped YAML files: beside a source tree, else share/ of the installation."""
    package = Path(__file__).resolve().parents[1]
    beside = package.parent / 'config'
    if (package.parent / 'package.xml').is_file() and beside.is_dir():
        return beside
    for parent in package.parents:
        installed = parent / 'share' / 'rigid_gns_ros' / 'config'
        if installed.is_dir():
            return installed
    raise ConfigError('the folder config/ of rigid_gns_ros was not found; reinstall the package')


def find_config(kind: str, name: str | Path) -> Path:
    """Path of a YAML file: `name` where it is one, else the shipped `config/kind/name.yaml`.

    Raises:
        ConfigError: Neither exists; the shipped names are listed.
    """
    path = Path(name)
    if path.suffix in ('.yaml', '.yml'):
        if path.is_file():
            return path
        raise ConfigError(f'{path}: no such file')
    folder = config_folder() / kind
    shipped = folder / f'{name}.yaml'
    if shipped.is_file():
        return shipped
    names = ', '.join(sorted(file.stem for file in folder.glob('*.yaml'))) or 'none'
    raise ConfigError(
        f'{kind}: no file and no shipped configuration {shown(str(name))}; shipped: {names}'
    )


def check_least(config: object, least: float, *names: str) -> None:
    """Raise UserError where a field of a configuration is below `least`, or not finite."""
    for name in names:
        value = getattr(config, name)
        if not value >= least:
            raise UserError(f'{name} is {value}, expected at least {least}')
        _check_finite(name, value)


def check_positive(config: object, *names: str) -> None:
    """Raise UserError where a field of a configuration is not above 0, or not finite."""
    for name in names:
        value = getattr(config, name)
        if not value > 0:
            raise UserError(f'{name} is {value}, expected more than 0')
        _check_finite(name, value)


def _check_finite(name: str, value: float) -> None:
    if value == math.inf:  # JSON, in which cards are written, has no such number
        raise UserError(f'{name} is {value}, expected a finite number')


def _convert(hint: Any, value: Any, where: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        errors, given = [], [a for a in arguments if a is not type(None)]
        # a mapping is meant for a dataclass, and nothing else is: one error tells enough
        nested = isinstance(value, Mapping) or dataclasses.is_dataclass(value)
        fitting = [a for a in given if dataclasses.is_dataclass(a) == nested]
        for argument in fitting or given:
            try:
                return _convert(argument, value, where)
            except ConfigError as error:
                errors.append(str(error))
        begin = f'{where} is {shown(value)}, expected '
        if all(error.startswith(begin) for error in errors):
            errors = [begin + ' or '.join(error.removeprefix(begin) for error in errors)]
        raise ConfigError(
            errors[-1] if len(errors) == 1 else f'{where} is {shown(value)}: {errors}'
        )
    if origin is typing.Literal:
        if value not in arguments:
            allowed = ', '.join(str(argument) for argument in arguments)
            raise ConfigError(f'{where} is {shown(value)}, allowed: {allowed}')
        return value
    if origin is tuple:
        if isinstance(value, str) or not isinstance(value, (list, tuple)):
            raise ConfigError(f'{where} is {shown(value)}, expected a list')
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            arguments = (arguments[0],) * len(value)
        if len(arguments) != len(value):
            raise ConfigError(f'{where} has {len(value)} values, expected {len(arguments)}')
        return tuple(
            _convert(argument, item, f'{where}[{index}]')
            for index, (argument, item) in enumerate(zip(arguments, value, strict=True))
        )
    if dataclasses.is_dataclass(hint):
        if isinstance(value, hint):  # type: ignore[arg-type]
            return value
        return from_mapping(hint, value, where)  # type: ignore[arg-type]
    if hint is float:
        if value == 'inf':
            return float('inf')
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            try:
                return float(value)
            except OverflowError:
                raise ConfigError(f'{where} {_too_large(value, sys.float_info.max)}') from None
        hint_text = ' (YAML reads 1e-3 as text: write 1.0e-3)' if isinstance(value, str) else ''
        raise ConfigError(f'{where} is {shown(value)}, expected a number{hint_text}')
    is_bool = isinstance(value, bool)  # a subclass of int
    if isinstance(hint, type) and (not isinstance(value, hint) or (is_bool and hint is not bool)):
        raise ConfigError(f'{where} is {shown(value)}, expected {hint.__name__}')
    if hint is int and abs(value) > _LARGEST_INT:
        raise ConfigError(f'{where} {_too_large(value, _LARGEST_INT)}')
    return value


def _too_large(value: float, bound: float) -> str:
    """What is wrong with a whole number; it may have too many digits to print."""
    return f'is a whole number of {int(value).bit_length()} bits, expected at most {bound:.4g}'
