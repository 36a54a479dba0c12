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

"""The networks alone, in what could run them: docs/decisions.md, "The engine".

Eager PyTorch, torch.compile (where there is a C++ compiler), ONNX Runtime (where onnxruntime, onnx
and onnxscript can be imported), and the engine; the same inputs, one thread, all in turns.

    OMP_NUM_THREADS=1 python benchmarks/engine_candidates.py

Of the contact model that is its encoder and four rounds on random contacts, without the law and
the impulses between the rounds, which all but the engine would leave to someone else; of the
thesis' GNS all from features to velocities, in a frame of a rollout.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import importlib.util
import logging
from pathlib import Path
import shutil
import tempfile
import time
from typing import Any, cast, NamedTuple
import warnings

import numba
import numpy as np
from rigid_gns_core import load_simulator
from rigid_gns_core.engine.contacts import Contacts
from rigid_gns_core.engine.layers import turn_over
from rigid_gns_core.engine.network import encode, gather_latents, read_round, tune, weights_of
from rigid_gns_core.files.tables import format_rows, number
from rigid_gns_core.gns.features import Features, features_of
from rigid_gns_core.gns.network import GNS, GraphInput
from rigid_gns_core.gns.numpy_network import GNSEngine
from rigid_gns_core.gns.stepper import GNSStepper
from rigid_gns_core.models.contact.network import ContactNetwork, Feel
from rigid_gns_core.prediction.simulators import ContactSimulator, GNSSimulator
from rigid_gns_core.running.machine import cpu_name, load_average
from rigid_gns_core.scenes.sampling import load_scene, sample_start
import torch
from torch import nn, Tensor

Run = Callable[[], np.ndarray]


class Candidate(NamedTuple):
    """Something that runs a network; ready_s: time to get it ready [s]."""

    name: str
    run: Run
    ready_s: float


class ContactRounds(nn.Module):
    """The contact model's network as one call: encoder and all rounds, impulses given.

    Speeds come as float32: ONNX Runtime has no asinh of float64 on a CPU.
    """

    def __init__(self, network: ContactNetwork, unit: float, bodies: int) -> None:
        super().__init__()
        self.network, self.unit, self.bodies = network, unit, bodies

    def forward(
        self, features: Tensor, feel: Tensor, a: Tensor, b: Tensor, weight_a: Tensor,
        weight_b: Tensor,
    ) -> Tensor:  # fmt: skip
        """Pace of normal impulse and friction, and momentum, of each round; shape (M, c, 3)."""
        latent, tunings = self.network.encode(features), []
        for index in range(len(self.network.rounds)):
            latent, tuning = self.network.round(
                index, latent, Feel(*feel[index].unbind(0)), self.unit, a, b, weight_a, weight_b,
                self.bodies,
            )  # fmt: skip
            tunings.append(torch.stack(tuning[:3], 1))
        return torch.stack(tunings)


class GNSVelocities(nn.Module):
    """The thesis' GNS as one call: next [v, omega] from the tensors of a `GraphInput`."""

    def __init__(self, network: GNS) -> None:
        super().__init__()
        self.network = network

    def forward(self, *tensors: Tensor) -> Tensor:
        """Next [v, omega] [m/s, rad/s], shape (n, 6)."""
        graph = GraphInput(*tensors)
        return self.network.decode(self.network(graph), graph.motion)


@numba.njit(error_model='numpy', fastmath={'contract'})
def engine_rounds(
    weights: Any, contacts: Any, group: Any, features: Any, feel: Any, weight: Any, unit: float,
    total: Any,
) -> Any:  # fmt: skip
    """`ContactRounds` of the engine's functions; features: before logarithms, shape (17, c)."""
    width, count = weights.encoder.shape[1], len(group)
    latent = np.zeros((width, count), np.float32)
    encode(weights, features.copy(), latent)
    result = np.empty((len(feel), count, 3))
    for index in range(len(feel)):
        inputs = np.empty((2 * width + 7, count), np.float32)
        rows = np.empty((count, width), np.float32)
        turn_over(latent, rows)
        gather_latents(contacts, group, rows, weight, len(total) - 1, total)
        for i in range(width):
            for q in range(count):
                inputs[i, q] = latent[i, q]
        turn_over(rows, inputs[width : 2 * width])
        for q in range(count):
            one = feel[index, :, q]
            seen = inputs[2 * width :, q]
            read_round(one[0], one[1], one[2], one[3], one[4], one[5], unit, seen)
        tune(weights, index, inputs, feel[index, 5], latent, result[index])
    return result


def contact_candidates(count: int, bodies: int) -> list[Candidate]:
    simulator = cast(ContactSimulator, load_simulator('contact', backend='torch'))
    draw = np.random.default_rng(0)
    rounds, unit = simulator.config.rounds, 0.12  # g h of a frame of 0.1 s in eight substeps
    features = draw.normal(size=(count, 17)).astype(np.float32)
    features[:, 10:12] = np.abs(features[:, 10:12])
    feel = (unit * draw.normal(size=(rounds, 6, count))).astype(np.float32)
    feel[:, [1, 2, 4]] = np.abs(feel[:, [1, 2, 4]])
    feel[:, 5] = draw.uniform(1, 5, (rounds, count))
    a, b = draw.integers(bodies, size=count), draw.integers(bodies + 1, size=count)
    b[a == b] = bodies
    weight = draw.uniform(0, 1, (count, 2))
    module = ContactRounds(simulator.network, unit, bodies + 1).eval()
    arrays = (features, feel, a, b, weight[:, 0].copy(), weight[:, 1].copy())
    contacts = torch.export.Dim('contacts', min=2, max=10**6)
    found = torch_candidates(module, arrays, ({0: contacts}, {2: contacts}, *[{0: contacts}] * 4))
    begin = time.perf_counter()
    weights = weights_of(simulator.tensors, rounds)
    zeros = np.zeros(count)
    whole = Contacts(
        np.arange(count), a, b, np.full(count, -1), zeros, np.zeros((count, 3)), zeros, zeros,
        zeros, zeros, zeros,
    )  # fmt: skip
    group, feel64, before = np.arange(count), feel.astype(np.float64), features.T.copy()
    before[:6], before[[10, 11, 16]] = np.sinh(before[:6]), np.exp(before[[10, 11, 16]])
    total = np.zeros((bodies + 1, simulator.config.width))

    def run() -> np.ndarray:
        return engine_rounds(weights, whole, group, before, feel64, weight, unit, total)

    run()
    return [*found, Candidate('engine (Numba)', run, time.perf_counter() - begin)]


def gns_candidates(steps: int) -> list[Candidate]:
    simulator = cast(GNSSimulator, load_simulator('gns', backend='torch'))
    scene, recipe = load_scene('box_154')
    begin = time.perf_counter()
    engine = GNSEngine(simulator.tensors, simulator.config)
    ready = time.perf_counter() - begin
    stepper = GNSStepper(
        engine, simulator.config, scene, sample_start(scene, recipe), simulator.units.dt
    )
    for _ in range(steps):
        stepper.step()
    features = features_of(simulator.config, stepper.motion, scene, stepper.dt)
    print(f'{len(features.nodes)} spheres, {len(features.edges)} particle edges, ', end='')
    print(f'{len(features.surface_edges)} surface edges')
    nodes, edges, surface = (
        torch.export.Dim(name, min=2, max=10**6) for name in ('nodes', 'edges', 'surface_edges')
    )
    sizes = Features(*({0: d} for d in (nodes, edges, surface, *[edges] * 3, surface, nodes)))
    found = torch_candidates(
        GNSVelocities(simulator.network).eval(), tuple(features), (tuple(sizes),)
    )
    return [*found, Candidate('engine (NumPy)', lambda: engine(features), ready)]


def torch_candidates(
    module: nn.Module, arrays: Sequence[np.ndarray], shapes: tuple[Any, ...]
) -> list[Candidate]:
    """Eager, compiled and exported; `shapes` says which sizes may change from call to call."""
    tensors = [torch.from_numpy(array) for array in arrays]

    def of_torch(function: Callable[..., Tensor]) -> Run:
        def run() -> np.ndarray:
            with torch.inference_mode():
                return function(*tensors).numpy()

        return run

    found = [Candidate('eager PyTorch', of_torch(module), 0.0)]
    if shutil.which('c++') or shutil.which('g++') or shutil.which('clang++'):
        for name, dynamic in (('torch.compile, sizes fixed', False), ('torch.compile', True)):
            torch.compiler.reset()
            begin = time.perf_counter()
            run = of_torch(torch.compile(module, dynamic=dynamic))
            run()
            found.append(Candidate(name, run, time.perf_counter() - begin))
    else:
        print('torch.compile left out: there is no C++ compiler')
    if all(importlib.util.find_spec(name) for name in ('onnxruntime', 'onnx', 'onnxscript')):
        found.append(onnx_candidate(module, tensors, shapes))
    else:
        print('ONNX Runtime left out: it needs onnxruntime, onnx and onnxscript')
    return found


def onnx_candidate(module: nn.Module, tensors: list[Tensor], shapes: tuple[Any, ...]) -> Candidate:
    import onnxruntime

    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter('ignore')
        path = Path(folder) / 'network.onnx'
        program = torch.onnx.export(
            module, tuple(tensors), dynamo=True, dynamic_shapes=shapes, verbose=False
        )
        assert program is not None
        program.save(str(path))
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        session = onnxruntime.InferenceSession(
            str(path), options, providers=['CPUExecutionProvider']
        )
    # an input that the outputs do not depend on is not one of the exported network
    given = {f'tensors_{k}': tensor.numpy() for k, tensor in enumerate(tensors)}
    names = [value.name for value in session.get_inputs()]
    if not set(names) <= set(given):
        given = dict(zip(names, given.values(), strict=True))
    inputs = {name: given[name] for name in names}
    run = cast(Run, lambda: session.run(None, inputs)[0])
    return Candidate(f'ONNX Runtime {onnxruntime.__version__}', run, time.perf_counter() - begin)


def compare(title: str, candidates: list[Candidate], turns: int) -> None:
    """Time all in turns and print a table; differences are to the first.

    Beside the time on the wall that of the processor, which what else is running adds less to.
    """
    expected = candidates[0].run()
    walls: list[list[float]] = [[] for _ in candidates]
    works: list[list[float]] = [[] for _ in candidates]
    for _ in range(turns):
        for candidate, wall, work in zip(candidates, walls, works, strict=True):
            candidate.run()  # brings its own data back into the caches
            begin, worked = time.perf_counter(), time.process_time()
            for _ in range(5):
                candidate.run()
            work.append((time.process_time() - worked) / 5)
            wall.append((time.perf_counter() - begin) / 5)
    print(f'{title}; load average {load_average()}')
    head = ['', 'median [ms]', 'quartiles [ms]', 'processor [ms]', 'ready [s]']
    rows = []
    for candidate, wall, work in zip(candidates, walls, works, strict=True):
        low, middle, high = (number(1e3 * q) for q in np.quantile(wall, (0.25, 0.5, 0.75)))
        times = middle, f'{low} to {high}', number(1e3 * np.median(work))
        apart = number(np.abs(candidate.run() - expected).max(), 2)
        rows.append([candidate.name, *times, number(candidate.ready_s, 2), apart])
    print(format_rows([*head, 'largest difference'], rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--turns', type=int, default=200, help='of 5 calls each (default 200)')
    parser.add_argument('--contacts', type=int, default=440, help='(default 440)')
    parser.add_argument('--bodies', type=int, default=200, help='that they share (default 200)')
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    logging.getLogger('torch.onnx').setLevel(logging.ERROR)
    print(f'{cpu_name()}, one thread, torch {torch.__version__}; load average {load_average()}')
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of exports
        contact = contact_candidates(arguments.contacts, arguments.bodies)
        gns = gns_candidates(30)
    title = f'contact model, {arguments.contacts} contacts, four rounds'
    compare(title, contact, arguments.turns)
    compare('GNS of the thesis', gns, max(arguments.turns // 4, 1))


if __name__ == '__main__':
    main()
