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

"""What a user may choose of a model that is loaded."""

from __future__ import annotations

from dataclasses import dataclass

BACKENDS = ('engine', 'torch')


def known_backend(name: str) -> str:
    """Return the name of a backend; ValueError where there is none such."""
    if name not in BACKENDS:
        raise ValueError(f'backend is {name!r}, allowed: {", ".join(BACKENDS)}')
    return name


@dataclass(frozen=True)
class ContactOptions:
    """What a user may change of a contact model; for measurements rather than for use.

    Args:
        backend: 'engine' (compiled), or 'torch', the reference; None: the engine where it can. It
            has neither float32 nor networks without the law.
        dtype: 'float64' or 'float32', of the arithmetic of contacts; states are kept in float64.
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
        network: Use the network; False: the law of isolated contacts alone.
        substeps: K instead of the trained one.
        rounds: M instead of the trained one, for the law alone.
        threads: CPU threads of the backend 'torch'; the engine takes one.
        everywhere: Spheres that nothing can touch take part in all substeps too, and isolated
            contacts in all rounds, with the network; to measure what leaving them out saves.
    """

    backend: str | None = None
    dtype: str = 'float64'
    guard: bool = True
    sleep: bool = True
    network: bool = True
    substeps: int | None = None
    rounds: int | None = None
    threads: int = 1
    everywhere: bool = False

    def __post_init__(self) -> None:
        if self.dtype not in ('float32', 'float64'):
            raise ValueError(f"dtype is {self.dtype!r}, allowed: 'float32', 'float64'")
        if self.backend is not None:
            known_backend(self.backend)
        for name in ('substeps', 'rounds'):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f'{name} is {value}, expected at least 1')
        if self.rounds is not None and self.network:
            raise ValueError('rounds can be changed only with network=False: each has its weights')
