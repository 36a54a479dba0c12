# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded bags: import of tracked poses, and scores of predictions against them."""
