# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks of spheres from frames of poses that carry no identity: association and velocities."""
