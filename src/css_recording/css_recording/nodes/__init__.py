# SPDX-License-Identifier: Apache-2.0
"""Node executables of this package, one in each file."""
