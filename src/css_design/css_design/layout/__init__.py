# SPDX-License-Identifier: Apache-2.0
"""Where the cells of a spacecraft should look."""
