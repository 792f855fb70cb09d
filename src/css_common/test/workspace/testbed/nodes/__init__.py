# SPDX-License-Identifier: Apache-2.0
"""Components of the made-up package, one each."""
