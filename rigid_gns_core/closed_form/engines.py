# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Engines as the checks call them: a simulator, and any engine with spheres of another size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .bounces import Simulate
from ..errors import UserError
from ..rollout.simulator import Simulator
from ..scenes.air import Air
from ..scenes.contact_law import ContactLaw, RestitutionCurve
from ..scenes.plane import Plane, Vector
from ..scenes.scene import Scene
from ..scenes.state import State, Trajectory


def simulator_engine(simulator: Simulator) -> Simulate:
    """Engine of the checks that calls this simulator."""

    def simulate(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        native = simulator.native_dt(scene)
        if abs(native - dt) > 1e-9 * dt:
            raise UserError(f'a check has steps of {dt:g} s, but the model has {native:g} s')
        return simulator.rollout(scene, steps=steps, **vars(start))

    return simulate


def scaled(simulate: Simulate, length: float) -> Simulate:
    """Engine that simulates each check `length` times as large, under the same gravity.

    Its trajectory is scaled back. By hand, not by `Similarity`, which is part of what is checked.
    Masses scale as volumes, times as the root of lengths.
    """
    time = float(np.sqrt(length))

    def times(value: float | tuple[float, ...], by: float) -> float | tuple[float, ...]:
        return tuple(v * by for v in value) if isinstance(value, tuple) else value * by

    def surface(plane: Plane) -> Plane:
        x, y, z = plane.point
        return replace(
            plane,
            point=(length * x, length * y, length * z),
            length_x=length * plane.length_x,
            length_y=length * plane.length_y,
            contact=law(plane.contact),
            velocity=faster(plane.velocity),
            angular_velocity=scaled_by(1.0 / time, plane.angular_velocity),
            surface_velocity=faster(plane.surface_velocity),
        )

    def scaled_by(factor: float, vector: Vector) -> Vector:
        x, y, z = (factor * value for value in vector)
        return x, y, z

    def faster(velocity: Vector) -> Vector:
        return scaled_by(length / time, velocity)

    def law(of: ContactLaw | None) -> ContactLaw | None:
        if of is None:
            return None
        curve = of.restitution
        if isinstance(curve, RestitutionCurve):
            curve = replace(curve, speed=curve.speed * length / time)
        slope = of.rolling_friction_slope * time / length
        return replace(of, restitution=curve, rolling_friction_slope=slope)

    def air(of: Air | None) -> Air | None:
        if of is None:
            return None
        crisis = of.crisis_speed * length / time
        return replace(
            of, wind=faster(of.wind), spin_decay=of.spin_decay / time, crisis_speed=crisis
        )

    def simulate_scaled(scene: Scene, start: State, steps: int, dt: float) -> Trajectory:
        larger = replace(
            scene,
            surfaces=tuple(map(surface, scene.surfaces)),
            obstacles=tuple(
                replace(obstacle.scaled(length), contact=law(obstacle.contact))
                for obstacle in scene.obstacles
            ),
            radius=times(scene.radius, length),
            mass=times(scene.mass, length**3),
            air=air(scene.air),
            sphere_contact=law(scene.sphere_contact),
        )
        run = simulate(
            larger,
            State(
                positions=length * start.positions,
                quaternions=start.quaternions,
                velocities=length / time * start.velocities,
                angular_velocities=start.angular_velocities / time,
            ),
            steps,
            time * dt,
        )
        return Trajectory(
            positions=run.positions / length,
            quaternions=run.quaternions,
            velocities=run.velocities * (time / length),
            angular_velocities=run.angular_velocities * time,
            dt=run.dt / time,
        )

    return simulate_scaled
