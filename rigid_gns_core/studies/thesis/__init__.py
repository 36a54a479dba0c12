# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The thesis' experiments (section 4); docs/thesis.md has the results."""
