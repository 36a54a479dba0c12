# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of topics, which parameters and remapping give: what is wrong with one is said."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TYPE_CHECKING

from rclpy.exceptions import InvalidParameterTypeException, NameValidationException
from rclpy.validate_topic_name import validate_topic_name
from rigid_gns_core.errors import UserError

if TYPE_CHECKING:
    from rclpy.node import Node


class TopicNames:
    """Topics of a node, each of one type.

    Args:
        node: The node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._kinds: dict[str, Any] = {}  # message type by resolved name

    @contextmanager
    def made(self, name: str, kind: Any) -> Iterator[None]:
        """Make a topic within this context.

        Args:
            name: Its name, not resolved.
            kind: Its message type.

        Raises:
            UserError: The name is none, or is of a topic of another type; or a parameter of its
                QoS cannot be used.
        """
        try:
            validate_topic_name(name)  # what resolves it says less of why it cannot be
            resolved = self._node.resolve_topic_name(name)
            known = self._kinds.setdefault(resolved, kind)
            # the middleware fails, too, but does not say why
            if known is not kind:
                raise UserError(
                    f'topic {resolved} would be of {kind.__name__}, but this node has it with '
                    f'{known.__name__}; give or remap it to another name'
                )
            yield
        except NameValidationException as error:
            raise UserError(' '.join(str(error).split()).rstrip(' ^')) from error
        except (RuntimeError, InvalidParameterTypeException) as error:
            raise UserError(f'qos_overrides of {name}: {error}') from error
