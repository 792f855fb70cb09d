# SPDX-License-Identifier: Apache-2.0
"""One executable a file: what the commands take and print. What they do is beside this folder."""
