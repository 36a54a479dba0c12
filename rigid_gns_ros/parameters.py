# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declares node parameters from the tables in `rigid_gns_core/forecasts/node_parameters.py`."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.node_parameters import ParameterSpec, Value

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.parameter import Parameter


def declare(node: Node, table: tuple[ParameterSpec, ...]) -> dict[str, Any]:
    """Declare all parameters of a table; a node with one that cannot be is destroyed.

    Returns:
        Their values by name.

    Raises:
        UserError: An initial value has the wrong type, is out of range or is not allowed.
    """
    from rcl_interfaces.msg import SetParametersResult

    try:
        values = {spec.name: _declare(node, spec) for spec in table}
    except UserError:
        # half built, it would end whenever its memory is collected, in any thread
        node.destroy_node()
        raise
    specs = {spec.name: spec for spec in table}

    def check(parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            spec = specs.get(parameter.name)
            if spec and (problem := spec.problem(parameter.value)):
                return SetParametersResult(successful=False, reason=problem)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)
    return values


def declared(node: Node, table: tuple[ParameterSpec, ...]) -> dict[str, Any]:
    """Present values of the parameters of a table, by name."""
    values = {spec.name: node.get_parameter(spec.name).value for spec in table}
    return {
        spec.name: list(values[spec.name]) if isinstance(spec.default, list) else values[spec.name]
        for spec in table
    }


def _declare(node: Node, spec: ParameterSpec) -> Any:
    from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException

    try:
        node.declare_parameter(spec.name, spec.default, _descriptor(spec))
    except InvalidParameterTypeException as error:
        raise UserError(
            f'parameter {spec.name} has the wrong type: {error}; give {_wanted(spec.default)}'
        ) from error
    except InvalidParameterValueException as error:
        raise UserError(
            f'parameter {spec.name}: {error}; '
            f'allowed: {spec.low:g} to {spec.high:g} {spec.unit}'.rstrip()
        ) from error
    found = node.get_parameter(spec.name).value
    value = list(found) if isinstance(spec.default, list) else found
    if problem := spec.problem(value):
        raise UserError(f'parameter {problem}')
    return value


def _wanted(default: Value) -> str:
    if isinstance(default, list):
        return f'{len(default)} floats, as {default}'
    return f'a {type(default).__name__}' + (', as 10.0' if isinstance(default, float) else '')


def _descriptor(spec: ParameterSpec) -> Any:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    text = f'{spec.description} [{spec.unit}]' if spec.unit else spec.description
    descriptor = ParameterDescriptor(description=text, read_only=not spec.dynamic)
    if spec.choices:
        descriptor.additional_constraints = f'one of: {", ".join(spec.choices)}'
    if isinstance(spec.default, list):
        descriptor.additional_constraints = f'{len(spec.default)} finite numbers'
    if isinstance(spec.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(spec.low), to_value=float(spec.high))
        ]
    elif isinstance(spec.default, int) and not isinstance(spec.default, bool):
        descriptor.integer_range = [
            IntegerRange(from_value=int(spec.low), to_value=int(spec.high))
        ]
    return descriptor
