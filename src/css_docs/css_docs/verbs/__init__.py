# SPDX-License-Identifier: Apache-2.0
"""What the commands do, loaded once their options are read."""
