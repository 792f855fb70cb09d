# SPDX-License-Identifier: Apache-2.0
"""One executable a file: what the commands of studies take and print. What they compute is beside this folder."""
