# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of real balls: laws fitted to half of the tracks, judged on the other half."""
