# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Base class of a node with the lifecycle of ROS 2: unconfigured, inactive, active, finalized."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
import traceback
from typing import Any

from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rigid_gns_core.errors import UserError

from .closing_node import ClosingNode


class ManagedNode(LifecycleNodeMixin, ClosingNode):
    """A node that a supervisor configures and activates, or that does so itself.

    rclpy drops what a transition raises. Here it is logged, or raised by `start`.

    Args:
        name: Name of the node.
        options: Passed on to `rclpy.node.Node`.
    """

    def __init__(self, name: str, **options: Any) -> None:
        ClosingNode.__init__(self, name, **options)
        LifecycleNodeMixin.__init__(self)
        self._starting = False
        self._failure: Exception | None = None
        # what is there before the first `configure`; None: nothing else is there yet
        self._kept: set[int] | None = None

    @abstractmethod
    def configure(self) -> None:
        """Read the parameters and make all that works, which begins as active."""

    @abstractmethod
    def activate(self) -> None:
        """Begin, or go on, to work."""

    @abstractmethod
    def deactivate(self) -> None:
        """Rest; what was recorded stays open."""

    @abstractmethod
    def release(self) -> None:
        """Finish the work, as far as it was begun; what it made in the node is destroyed then."""

    def start(self) -> None:
        """Configure and activate.

        Raises:
            Exception: What failed.
        """
        self._starting = True
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() != TransitionCallbackReturn.SUCCESS:
                # its traceback holds this node, which would hold it
                failure, self._failure = self._failure, None
                self.destroy_node()
                raise failure or RuntimeError('a transition of the lifecycle failed')
        self._starting = False

    def destroy_node(self) -> None:
        """Destroy the node, and what rclpy's lifecycle keeps it alive by."""
        super().destroy_node()
        self.__dict__.pop('_state_machine', None)

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Configure, and rest."""
        self._kept = {id(entity) for entities, _ in self._entities() for entity in entities}

        def configure() -> None:
            self.configure()
            if not self._starting:
                self.deactivate()

        result = self._tried(configure)
        if result != TransitionCallbackReturn.SUCCESS:
            self._destroy()
        return result

    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Activate."""
        return self._tried(self.activate)

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate."""
        return self._tried(self.deactivate)

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Release all that was configured."""
        result = self._tried(self.release)
        self._destroy()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As `on_cleanup`, for good."""
        return self.on_cleanup(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As `on_cleanup`, after an unexpected error."""
        return self.on_cleanup(state)

    def _tried(self, action: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            action()
        except Exception as error:
            self._failure = error
            expected = isinstance(error, (UserError, OSError, ImportError))
            if not self._starting:
                self.get_logger().error(str(error) if expected else traceback.format_exc())
            failed = TransitionCallbackReturn
            return failed.FAILURE if expected else failed.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _entities(self) -> list[tuple[list[Any], Callable[[Any], bool]]]:
        return [
            (list(self.publishers), self.destroy_publisher),
            (list(self.subscriptions), self.destroy_subscription),
            (list(self.services), self.destroy_service),
            (list(self.timers), self.destroy_timer),
            (list(self.guards), self.destroy_guard_condition),
        ]

    def _destroy(self) -> None:
        """Destroy what `configure` made in the node."""
        if self._kept is None:
            return
        for entities, destroy in self._entities():
            for entity in entities:
                if id(entity) not in self._kept:
                    destroy(entity)
