# SPDX-License-Identifier: Apache-2.0
"""Programs of this package, one in each file."""
