"""`ros2 run rigid_gns_ros simulator`: tracked poses in, predicted poses out, in real time."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from rclpy.clock import JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from .alarm import Alarm
from .channels import Channels
from .forecast import Forecaster, Prediction
from .messages import PoseArrayCodec, decode_pose_array, encode_float64, encode_string
from .parameters import SIMULATOR, declare
from .predictor import PredictionError, Predictor
from .process import ClosingNode, log_end, run_node
from .tracking import RESTART_FRAMES, RejectedFrame, Throttle, TrackingWindow, seconds

# frames further apart than this many model steps, and than this time, are not fitted as one flight
WINDOW_GAP_STEPS = 10
WINDOW_GAP = 0.25  # [s]
# a longer jump of simulated time starts anew
JUMP = Duration(seconds=1, nanoseconds=1)
LOG_PERIOD = 5.0  # [s], of lines that could repeat


class SimulatorNode(ClosingNode):
    """Starts from tracked poses, predicts what the spheres do next, publishes and records it.

    Args:
        options: Passed on to `rclpy.node.Node`.

    Raises:
        ValueError: A parameter cannot be used.
        OSError: The bag cannot be made.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('simulator', **options)
        values = declare(self, SIMULATOR)
        self._throttle = Throttle(LOG_PERIOD)
        self._frame_id = str(values['frame_id'])
        self._model = Forecaster(
            str(values['model']),
            str(values['scene']),
            rate=float(values['rate']),
            threads=int(values['threads']),
        )
        self._window = TrackingWindow(
            frame_id=self._frame_id,
            length=int(values['velocity_window']),
            max_spheres=int(values['max_spheres']),
            gravity=self._model.scene.gravity,
            max_gap=max(WINDOW_GAP_STEPS * self._model.native_dt, WINDOW_GAP),
            radius=self._model.radius,
            check=self._check_count,
            on_gap=self._warn_gap,
        )
        self._predictor = Predictor(
            self._model,
            self._window,
            every=values['start'] == 'every',
            warn=self._warn,
            error=self.get_logger().error,
        )
        self._codec: PoseArrayCodec | None = None
        self._paused = False
        self._rejected = 0

        self.add_post_set_parameters_callback(self._take_parameters)
        self._alarm = Alarm(self, self._on_due)
        self._channels = Channels(self, self._on_tracked, str(values['record']))
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_service(Trigger, '~/step', self._on_step)
        jumps = JumpThreshold(
            min_forward=JUMP, min_backward=Duration(nanoseconds=-1), on_clock_change=False
        )
        self._jump_handle = self.get_clock().create_jump_callback(
            jumps, post_callback=self._on_jump
        )
        description = {
            **self._model.description,
            'parameters': values,
            'topics': self._channels.topics,
        }
        self._channels.send(self._channels.scene, encode_string(json.dumps(description)))
        self.get_logger().info(
            f'ready: {self._model}; waiting for {self._window.length} frames on '
            f'{self._channels.tracked.topic_name}'
            + (f'; recording into {values["record"]}' if values['record'] else '')
        )

    def close(self) -> None:
        """Stop predicting and finish the bag."""
        self._alarm.cancel()
        bag = self._channels.close()
        counts = {**self._predictor.counts, 'rejected': self._rejected}
        text = ', '.join(f'{count} {name}' for name, count in counts.items())
        log_end(f'stopped: {text}' + (f'; {bag}' if bag else ''))

    # --- tracked frames ---

    def _on_tracked(self, cdr: bytes) -> None:
        now = self._now()
        try:
            if now == 0:
                raise RejectedFrame('clock', 'use_sim_time is set, but no /clock has come yet')
            restarted = self._window.add(decode_pose_array(cdr), now)
        except ValueError as error:
            self._rejected += 1
            self._warn(getattr(error, 'kind', 'bytes'), f'tracked message rejected: {error}')
            return
        self._channels.received(cdr)
        if restarted:
            self._alarm.cancel()
            self._predictor.stop()
            self._warn(
                'restarted',
                f'the tracker has begun anew: {RESTART_FRAMES} frames in a row with '
                'stamps that rise, but do not follow those before; starting again from them',
            )
        if self._predictor.forecast is None and self._window.full:
            self._start(now)

    def _check_count(self, count: int) -> None:
        for text in self._model.check(count):
            self._warn(text, text)

    def _warn_gap(self, gap: float) -> None:
        if self._predictor.forecast is None or self._predictor.every:
            limit = self._window.max_gap_ns * 1e-9
            self._warn(
                'gap',
                f'tracked frames are {gap:.4g} s apart, more than {limit:.4g} s, and are '
                f'not fitted together: waiting for {self._window.length} that are closer; where '
                'the tracker is so slow, set velocity_window:=1 (starts at rest)',
            )

    # --- predictions ---

    def _start(self, now: int) -> None:
        try:
            self._predictor.start(now)
        except PredictionError as error:
            self._give_up(error)
            return
        count = self._window.count or 0
        self._codec = PoseArrayCodec(self._frame_id, count)
        self.get_logger().info(
            f'started from stamp {seconds(self._window.stamp_ns or 0)} s: {count} spheres, '
            f'velocities from {self._window.length} frames'
        )
        self._compute()

    def _compute(self) -> None:
        try:
            prediction = self._predictor.compute(self._now())
        except PredictionError as error:
            self._give_up(error)
            return
        for step_time in prediction.step_times:
            self._channels.send(self._channels.step_time, encode_float64(step_time))
        if not self._paused:
            self._alarm.set(self._predictor.due_ns)

    def _on_due(self) -> None:
        predictor = self._predictor
        if predictor.forecast is None:
            return
        if predictor.pending is None:  # half a period before the next
            self._channels.drain()
            if predictor.forecast is not None and predictor.pending is None:
                self._compute()
            return
        prediction = predictor.take_in_time(self._now())
        if prediction is not None:
            self._publish(prediction)
        if predictor.every:
            self._alarm.set(predictor.due_ns + predictor.period_ns // 2)
        else:
            self._compute()

    def _publish(self, prediction: Prediction) -> None:
        assert self._codec is not None
        cdr = self._codec.encode(prediction.poses, prediction.stamp_ns)
        self._channels.send(self._channels.predicted, cdr)

    def _give_up(self, error: PredictionError) -> None:
        self._forget()
        self._warn(error.kind, str(error))

    # --- services, parameters, clock ---

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._forget()
        response.success = True
        response.message = f'waiting for {self._window.length} tracked frames'
        self.get_logger().info(f'reset: {response.message}')
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        changed = request.data != self._paused
        self._paused = request.data
        if changed and self._paused:
            self._alarm.cancel()
        elif changed and self._predictor.every:
            self._forget()  # what is tracked has moved on meanwhile
        elif changed and self._predictor.forecast is not None:
            if self._predictor.pending is None:
                self._compute()
            self._predictor.resume(self._now())
            if self._predictor.pending is not None:
                self._alarm.set(self._predictor.due_ns)
        response.success = True
        response.message = ('paused' if self._paused else 'running') if changed else 'no change'
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        predictor = self._predictor
        if self._paused and predictor.forecast is not None and predictor.pending is None:
            self._compute()
        if not self._paused:
            response.message = 'not paused: call ~/pause with data: true first'
        elif predictor.pending is None:
            response.message = 'not started: no tracked frames yet'
        else:
            prediction = predictor.take()
            response.success = True
            stamp = seconds(prediction.stamp_ns)
            response.message = f'published prediction {predictor.index} for {stamp} s'
            self._publish(prediction)
            if not predictor.every:
                self._compute()
        return response

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == 'start':
                self._predictor.every = parameter.value == 'every'

    def _on_jump(self, jump: TimeJump) -> None:
        if self._window.stamp_ns is None:
            return
        self._forget()
        ahead = jump.delta.nanoseconds * 1e-9
        way = 'backwards' if ahead < 0 else f'forward by {ahead:.3f} s at once'
        self.get_logger().info(f'the clock went {way}: waiting for new tracked frames')

    def _forget(self) -> None:
        self._alarm.cancel()
        self._window.clear()
        self._predictor.stop()

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds

    def _warn(self, kind: str, text: str) -> None:
        held = self._throttle.admit(kind, time.monotonic())
        if held is not None:
            more = f' ({held} more since the last line)' if held else ''
            self.get_logger().warning(text + more)


def main() -> int:
    """Run the node until a signal comes; returns the exit code."""
    return run_node('simulator', SimulatorNode)


if __name__ == '__main__':
    sys.exit(main())
