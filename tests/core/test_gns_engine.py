# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The thesis' network in NumPy does what it does in torch."""

import warnings

import numpy as np
from rigid_gns_core import load_simulator, Plane, Scene

# One step in float32 arithmetic is good to 1e-6; a network loses another digit.
ONE_STEP = 1e-5


def test_the_thesis_network_is_that_of_the_reference():
    rng = np.random.default_rng(4)
    grid = 2.2 * np.stack(np.meshgrid(*[np.arange(3)] * 3), -1).reshape(-1, 3)[:20]
    positions = grid + rng.uniform(-0.08, 0.08, grid.shape) + [-2.2, -2.2, 1.2]
    velocities = 3.0 * rng.normal(size=positions.shape)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # its materials
        found, expected = (
            load_simulator('gns', backend=backend).rollout(
                Scene(surfaces=Plane.box(12.0, 12.0)), positions, velocities, steps=1
            )
            for backend in ('engine', 'torch')
        )
    for name, scale in (
        ('positions', 1.0),
        ('velocities', 0.1),
        ('angular_velocities', 0.1),
        ('quaternions', 1.0),
    ):
        one, other = getattr(found, name), getattr(expected, name)
        assert scale * np.abs(one - other).max() < ONE_STEP
