# SPDX-License-Identifier: Apache-2.0
"""Executables for people: each is a verb of `./sunpoint` and a `ros2 run css_bringup` entry."""
