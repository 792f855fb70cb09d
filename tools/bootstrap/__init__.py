# SPDX-License-Identifier: Apache-2.0
"""What `./sunpoint` does before a verb runs: install, build, compose the environment.

Standard library only, as it runs before anything is installed.
"""
