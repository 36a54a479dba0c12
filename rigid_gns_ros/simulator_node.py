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
from .forecast import Forecast, Forecaster, Prediction
from .messages import PoseArrayCodec, decode_pose_array, encode_float64, encode_string
from .parameters import SIMULATOR, declare
from .process import ClosingNode, log_end, run_node
from .tracking import RejectedFrame, Throttle, TrackingWindow, seconds

# a tracker whose clock is further off than this is followed on its own clock [ns]
CLOCK_TOLERANCE_NS = 1_000_000_000
# frames further apart than this many model steps are not fitted as one flight
WINDOW_GAP_STEPS = 10
# stamps of a tracker may be so many periods off equal times
JITTER = 0.25
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
        self._start_mode = str(values['start'])
        self.add_post_set_parameters_callback(self._take_parameters)
        self._throttle = Throttle(LOG_PERIOD)
        self._frame_id = str(values['frame_id'])
        self._model = Forecaster(
            str(values['model']),
            str(values['scene']),
            rate=float(values['rate']),
            threads=int(values['threads']),
        )
        self._period = self._model.period
        self._window = TrackingWindow(
            frame_id=self._frame_id,
            length=int(values['velocity_window']),
            max_spheres=int(values['max_spheres']),
            gravity=self._model.scene.gravity,
            max_gap=WINDOW_GAP_STEPS * self._model.native_dt,
            check=self._check_count,
        )
        self._forecast: Forecast | None = None
        self._pending: Prediction | None = None  # computed, not yet published
        self._period_ns = round(self._period * 1e9)
        self._jitter_ns = round(JITTER * self._period * 1e9)
        self._latest_ns = 0  # stamp that a prediction in place of the pending one may have
        self._codec: PoseArrayCodec | None = None
        self._paused = False
        self._offset_ns = 0  # node clock minus the tracker's clock, 0 where they agree
        self._last_stamp_ns: int | None = None  # of the newest prediction published
        self._counts = {'published': 0, 'skipped': 0, 'rejected': 0}

        self._alarm = Alarm(self, self._on_due)
        self._channels = Channels(self, self._on_tracked, str(values['record']))
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_service(Trigger, '~/step', self._on_step)
        backwards = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False
        )
        self._jump_handle = self.get_clock().create_jump_callback(
            backwards, post_callback=self._on_jump_back
        )
        description = {**self._model.description, 'parameters': values}
        self._channels.send(self._channels.scene, encode_string(json.dumps(description)))
        self.get_logger().info(
            f'ready: {self._model}; waiting for {self._window.length} frames on '
            f'{self._channels.tracked.topic_name}'
            + (f'; recording into {values["record"]}' if values['record'] else '')
        )

    def close(self) -> None:
        """Stop predicting and finish the bag."""
        self._alarm.cancel()
        folder = self._channels.close()
        counts = ', '.join(f'{count} {name}' for name, count in self._counts.items())
        log_end(f'stopped: {counts}' + (f'; bag in {folder}' if folder else ''))

    # --- tracked frames ---

    def _on_tracked(self, cdr: bytes) -> None:
        now = self._now()
        try:
            if now == 0:
                raise RejectedFrame('clock', 'use_sim_time is set, but no /clock has come yet')
            self._window.add(decode_pose_array(cdr))
        except ValueError as error:
            self._counts['rejected'] += 1
            self._warn(getattr(error, 'kind', 'bytes'), f'tracked message rejected: {error}')
            return
        self._channels.received(cdr)
        if self._window.full and self._wants_start():
            self._start(now)

    def _check_count(self, count: int) -> None:
        for text in self._model.check(count):
            self._warn(text, text)

    def _wants_start(self) -> bool:
        """Whether the newest frame starts a forecast now rather than later or never."""
        if self._forecast is None:
            return True
        newest = self._window.stamp_ns or 0
        if self._start_mode != 'every' or self._paused or newest <= self._forecast.start_ns:
            return False
        if self._pending is not None:
            # it gives way only to one for about the same time or an earlier one, or a tracker
            # faster than the predictions would put each of them off for ever
            return newest + self._period_ns <= self._latest_ns
        if self._last_stamp_ns is None:
            return True
        # whole periods after the newest frame: is one of them about a period after the last?
        earliest = self._last_stamp_ns + self._period_ns - self._jitter_ns
        periods = max(1, -((newest - earliest) // self._period_ns))
        return newest + periods * self._period_ns <= earliest + 2 * self._jitter_ns

    def _start(self, now: int) -> None:
        try:
            stamp, state = self._window.start()
            forecast = self._model.forecast(state, stamp)
        except ValueError as error:
            self._forget()
            self._warn('start', f'no start from these tracked frames: {error}')
            return
        self._offset_ns = self._clock_offset(stamp, now)
        if self._last_stamp_ns is not None:
            forecast.skip_to(self._last_stamp_ns + self._period_ns - self._jitter_ns)
        if self._forecast is None:
            self._codec = PoseArrayCodec(self._frame_id, len(state))
            self.get_logger().info(
                f'started from stamp {seconds(stamp)} s: {len(state)} spheres, '
                f'velocities from {self._window.length} frames'
            )
        self._forecast = forecast
        self._advance()

    def _clock_offset(self, stamp: int, now: int) -> int:
        for known in (0, self._offset_ns):
            if abs(now - stamp - known) <= CLOCK_TOLERANCE_NS:
                return known
        self._warn(
            'offset',
            f'tracked stamp {seconds(stamp)} s is {(now - stamp) * 1e-9:+.3f} s off the '
            "node's clock, expected at most 1 s: predictions follow the tracker's stamps, in time "
            'with their arrival; does use_sim_time fit?',
        )
        return now - stamp

    # --- predictions ---

    def _advance(self) -> None:
        """Compute the next prediction, ahead of the time it is due."""
        assert self._forecast is not None
        fresh = self._pending is None
        try:
            self._pending = self._forecast.advance()
        except (ValueError, FloatingPointError) as error:
            index = self._forecast.next_index
            self._forget()
            self._warn('diverged', f'prediction {index} failed: {error}; starting again')
            return
        if fresh:
            self._latest_ns = self._pending.stamp_ns + self._jitter_ns
        for step_time in self._pending.step_times:
            self._channels.send(self._channels.step_time, encode_float64(step_time))
        if not self._paused:
            self._alarm.set(self._pending.stamp_ns + self._offset_ns)

    def _on_due(self) -> None:
        if self._forecast is None:
            return
        if self._pending is None:  # the frame waited for did not come
            if self._window.full and (self._window.stamp_ns or 0) > self._forecast.start_ns:
                self._start(self._now())
            else:
                self._advance()
            return
        now, due = self._now(), self._pending.stamp_ns + self._offset_ns
        late = (now - due) * 1e-9
        if late > self._period:
            self._counts['skipped'] += 1
            self._warn(
                'late',
                f'{late:.3f} s late, more than the period of {self._period:.4g} s: '
                f'{self._counts["skipped"]} predictions computed but not published so far; '
                f'the last step took {max(self._pending.step_times, default=0.0):.4g} s',
            )
            self._pending = None
        else:
            self._publish_pending()
        if self._start_mode != 'every':
            self._advance()
        elif self._window.full and self._wants_start():
            self._start(now)
        else:  # a frame for the next prediction is about to come
            self._alarm.set(due + self._period_ns // 2)

    def _publish_pending(self) -> None:
        assert self._pending is not None and self._codec is not None
        cdr = self._codec.encode(self._pending.poses, self._pending.stamp_ns)
        self._channels.send(self._channels.predicted, cdr)
        self._last_stamp_ns = self._pending.stamp_ns
        self._counts['published'] += 1
        self._pending = None

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
        elif changed and self._forecast is not None:
            # the schedule moves by the length of the pause, with one period to get going
            due = self._now() + self._period_ns
            if self._pending is None:
                self._advance()
            if self._pending is not None:
                self._offset_ns = due - self._pending.stamp_ns
                self._alarm.set(due)
        response.success = True
        response.message = ('paused' if self._paused else 'running') if changed else 'no change'
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._paused and self._forecast is not None and self._pending is None:
            self._advance()
        if not self._paused:
            response.message = 'not paused: call ~/pause with data: true first'
        elif self._pending is None:
            response.message = 'not started: no tracked frames yet'
        else:
            stamp = seconds(self._pending.stamp_ns)
            response.success = True
            response.message = f'published prediction {self._pending.index} for {stamp} s'
            self._publish_pending()
            self._advance()
        return response

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == 'start':
                self._start_mode = str(parameter.value)

    def _on_jump_back(self, _: TimeJump) -> None:
        self._forget()
        self.get_logger().info('the clock went backwards: waiting for new tracked frames')

    def _forget(self) -> None:
        self._alarm.cancel()
        self._window.clear()
        self._forecast = self._pending = self._last_stamp_ns = None

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds

    def _warn(self, kind: str, text: str) -> None:
        held = self._throttle.admit(kind, time.monotonic())
        if held is not None:
            more = f' ({held} more since the last line)' if held else ''
            self.get_logger().warning(text + more)


def main() -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit code."""
    return run_node('simulator', SimulatorNode)


if __name__ == '__main__':
    sys.exit(main())
