# SPDX-License-Identifier: Apache-2.0
"""MCAP flight recordings in rosbag2 layout: recorder, player, recovery and reading."""
