# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""From tracked spheres to predictions that are due. No ROS in here."""
