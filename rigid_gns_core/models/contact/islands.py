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

"""Islands: spheres that contacts connect in a frame. Surfaces belong to none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .geometry import Contacts

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Islands:
    """Contacts of a frame and the islands they make.

    Args:
        label: Island of each sphere, shape (n,); a sphere without contact is one of its own.
        count: Number of islands.
        touched: Spheres with a contact, shape (n,).
        grounded: Islands that touch a surface, shape (count,).
    """

    label: Indices
    count: int
    touched: NDArray[np.bool_]
    grounded: NDArray[np.bool_]

    @classmethod
    def of(cls, contacts: Sequence[Contacts], spheres: int) -> Islands:
        """Islands of all contacts of a frame's substeps."""
        touched = np.zeros(spheres, dtype=bool)
        supported = np.zeros(spheres, dtype=bool)
        first, second = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for some in contacts:
            a, b = some.a.numpy(), some.b.numpy()
            fixed = some.plane.numpy() >= 0
            touched[a] = True
            touched[b[~fixed]] = True
            supported[a[fixed]] = True
            first.append(a[~fixed])
            second.append(b[~fixed])
        one, other = np.concatenate(first), np.concatenate(second)
        edges = coo_array((np.ones(len(one)), (one, other)), shape=(spheres, spheres))
        count, label = connected_components(edges, directed=False)
        grounded = np.zeros(count, dtype=bool)
        grounded[label[supported]] = True
        return cls(label.astype(np.int64), int(count), touched, grounded)

    def sum(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum over the spheres of each island, shape (count, ...)."""
        total = np.zeros((self.count, *values.shape[1:]))
        np.add.at(total, self.label, values)
        return total

    def all(self, flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether all spheres of an island have a flag, shape (count,)."""
        every = np.ones(self.count, dtype=bool)
        every[self.label[~flags]] = False
        return every
