# SPDX-License-Identifier: Apache-2.0
"""Commands: options in, exit code out."""
