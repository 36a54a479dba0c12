# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Building blocks of the network: multilayer perceptron and normaliser."""

from __future__ import annotations

import torch
from torch import nn, Tensor


class MLP(nn.Module):
    """Linear, ReLU, linear; no activation at the end (thesis section 4.1).

    The input may come in parts: `MLP((a, b), ...)(x_a, x_b)` equals one linear layer on their
    concatenation. Parts save work where one of them is shared: a node's part is computed once per
    node with `part`, then gathered per edge.
    """

    def __init__(self, inputs: tuple[int, ...], hidden: int, outputs: int) -> None:
        super().__init__()
        whole = nn.Linear(sum(inputs), hidden)
        self.weights = nn.ParameterList(
            nn.Parameter(part.detach().clone()) for part in whole.weight.split(list(inputs), dim=1)
        )
        self.bias = nn.Parameter(whole.bias.detach().clone())
        self.last = nn.Linear(hidden, outputs)

    def part(self, index: int, value: Tensor) -> Tensor:
        """Share of input part `index` in the hidden layer, shape (..., hidden)."""
        share: Tensor = value @ self.weights[index].T
        return share

    def finish(self, hidden: Tensor) -> Tensor:
        """Outputs from the sum of all parts, shape (..., outputs)."""
        output: Tensor = self.last(torch.relu(hidden + self.bias))
        return output

    def forward(self, *values: Tensor) -> Tensor:
        hidden = self.part(0, values[0])
        for index, value in enumerate(values[1:], start=1):
            hidden = hidden + self.part(index, value)
        return self.finish(hidden)


class Normaliser(nn.Module):
    """Standardise features; statistics, shape (size,), are buffers and travel with the weights."""

    mean: Tensor
    scale: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer('mean', torch.zeros(size))
        self.register_buffer('scale', torch.ones(size))

    @torch.no_grad()
    def fit(self, mean: Tensor, scale: Tensor) -> None:
        """Set the statistics, shape (size,); a feature that never varies keeps scale 1."""
        self.mean.copy_(mean)
        self.scale.copy_(torch.where(scale > 1e-8, scale, torch.ones_like(scale)))

    def forward(self, value: Tensor) -> Tensor:
        return (value - self.mean) / self.scale

    def inverse(self, value: Tensor) -> Tensor:
        """Undo `forward`."""
        return value * self.scale + self.mean
