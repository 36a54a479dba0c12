# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS messages as CDR bytes, and the message definitions that a bag stores."""
