# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags: rosbag2 folders of MCAP files, written and read without ROS."""
