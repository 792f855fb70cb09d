# SPDX-License-Identifier: Apache-2.0
"""One figure a module: `figure()` makes it from the code that flies, and `CAPTION` says what it shows."""
