# SPDX-License-Identifier: Apache-2.0
"""A console in the browser for flights and recordings."""
