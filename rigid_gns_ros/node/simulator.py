# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `simulator`: its lifecycle, parameters, services and clock."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import json
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.crossing_planes import planes_of
from rigid_gns_core.forecasts.forecaster import Forecaster, with_gravity_along
from rigid_gns_core.forecasts.moving_surfaces import bodies_of, MovingSurfaces
from rigid_gns_core.forecasts.node_parameters import SIMULATOR
from rigid_gns_core.messages.poses import encode_string
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.tracking.usable_frames import seconds
from std_srvs.srv import SetBool, Trigger

from .clock_jumps import on_jump
from .closing_node import log_end
from .events import look_now_and_then
from .executor import Quick
from .managed_node import ManagedNode
from .markers import encode_surfaces
from .simulation import Simulation
from .threads import bound_threads, switch_often
from ..parameters import declare, declared

DIAGNOSTICS_PERIOD = 1.0  # [s] of real time


class SimulatorNode(ManagedNode):
    """Predicts the poses of tracked spheres, and publishes and records them.

    Args:
        options: Passed on to `rclpy.node.Node`.

    Raises:
        UserError: A parameter cannot be used.
        OSError: The bag cannot be created.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('simulator', **options)
        declare(self, SIMULATOR)
        self.simulation: Simulation
        self._configured = False
        self._told: Callable[[], None] | None = None  # what is said at the first activation
        self.add_post_set_parameters_callback(self._take_parameters)
        if self.get_parameter('autostart').value:
            self.start()
        else:
            self.get_logger().info('unconfigured: waiting for a supervisor (autostart is off)')

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return self.simulation.quick if self._configured else {}

    def lull(self) -> float:
        """See `executor`."""
        return self.simulation.lull if self._configured else 0.0

    def drain(self) -> None:
        """See `executor`."""
        if self._configured:
            self.simulation.topics.drain()

    def configure(self) -> None:
        """Load scene and model, and make topics and services."""
        values = declared(self, SIMULATOR)
        surfaces = MovingSurfaces(
            with_gravity_along(load_scene(str(values['scene'])), values['gravity_direction']),
            bodies_of(str(values['moving_surfaces'])),
        )
        model = Forecaster(
            str(values['model']),
            surfaces.fixed,
            scene_name=str(values['scene']),
            rate=float(values['rate']),
            threads=int(values['threads']),
        )
        bound_threads(int(values['threads']))
        switch_often()
        surfaces.check_model(model.simulator.kind)
        self.simulation = Simulation(self, model, values, surfaces)
        self._configured = True
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_service(Trigger, '~/step', self._on_step)
        self.create_service(Trigger, '~/save_scene', self._on_save)
        self._jump_handle = on_jump(self, self.simulation.on_clock_jump)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(DIAGNOSTICS_PERIOD, self.simulation.report, clock=steady)
        look_now_and_then(self)
        self._told = partial(self._tell, model, values)

    def activate(self) -> None:
        """Take tracked frames, and predict."""
        self.simulation.activate()
        if self._told is not None:
            self._told()
            self._told = None

    def deactivate(self) -> None:
        """Neither hear nor say anything; the bag stays open."""
        self.simulation.deactivate()

    def release(self) -> None:
        """Stop predicting and finish the bag."""
        if self._configured:
            self._configured = False
            self._jump_handle.unregister()
            log_end(f'stopped: {self.simulation.close()}')

    def close(self) -> None:
        """Stop predicting and finish the bag."""
        self.release()

    def _tell(self, model: Forecaster, values: dict[str, Any]) -> None:
        """Publish ~/scene, and log model, scene and topics."""
        topics, window = self.simulation.topics, self.simulation.window
        description = {**model.description, 'parameters': values, 'topics': topics.names}
        topics.send(topics.scene, encode_string(json.dumps(description)))
        topics.surfaces.publish(encode_surfaces(model.scene, window.frame_id))
        if not model.level:
            self.get_logger().warning(
                'no surface is level: none has a normal against gravity '
                f'{list(model.scene.gravity)} m/s^2, so that nothing can lie still; are gravity '
                'and surfaces given in the same frame?'
            )
        self.get_logger().info(
            f'ready: {model}; waiting for {window.length} frames on '
            f'{topics.tracked}'
            + (f'; recording into {values["record"]}' if values['record'] else '')
        )

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.simulation.forget('reset')
        response.success = True
        response.message = f'waiting for {self.simulation.window.length} tracked frames'
        self.get_logger().info(f'reset: {response.message}')
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        changed = self.simulation.pause(request.data)
        response.success = True
        state = 'paused' if self.simulation.paused else 'running'
        response.message = state if changed else 'no change'
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        simulation, predictor = self.simulation, self.simulation.predictor
        failure = ''
        if simulation.paused and predictor.forecast is not None and predictor.pending is None:
            failure = simulation.predictions.compute()
        if not simulation.paused:
            response.message = 'not paused: call ~/pause with data: true first'
        elif predictor.pending is None:
            response.message = failure or 'not started: no tracked frames yet'
        else:
            prediction = predictor.take()
            response.success = True
            stamp = seconds(prediction.stamp_ns)
            response.message = f'published prediction {predictor.index} for {stamp} s'
            simulation.predictions.publish(prediction)
            if not predictor.every:
                simulation.predictions.compute()
        return response

    def _on_save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        path = str(self.get_parameter('learned_scene').value)
        try:
            response.message = self.simulation.learning.save(path)
            response.success = True
        except (OSError, UserError) as error:
            response.message = str(error)
        return response

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        if not self._configured:
            return  # they are read when it is
        resync = self.simulation.predictor.resync
        for parameter in parameters:
            if parameter.name == 'start':
                resync.start = str(parameter.value)
            elif parameter.name == 'resync_error':
                resync.bound = float(parameter.value)
            elif parameter.name == 'resync_over':
                resync.over = str(parameter.value)
            elif parameter.name == 'tracker_timeout':
                self.simulation.silence.timeout = float(parameter.value)
            elif parameter.name == 'horizon':
                self.simulation.futures.seconds = float(parameter.value)
            elif parameter.name == 'samples':
                self.simulation.futures.samples = int(parameter.value)
            elif parameter.name == 'crossing_planes':
                self.simulation.futures.planes = planes_of(str(parameter.value))
