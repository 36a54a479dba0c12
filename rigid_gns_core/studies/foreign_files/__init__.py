# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Damaged and odd files of every kind that is read, by seed, and what reading them must not do."""
