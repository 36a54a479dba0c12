# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Worlds that the laws do not know, learned from noisy tracked poses; see docs/residual.md."""
