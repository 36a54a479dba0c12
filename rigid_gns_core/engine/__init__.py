# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction without torch: the laws compiled by Numba, the thesis' GNS in NumPy."""
