# SPDX-License-Identifier: Apache-2.0
"""The kernels that flew as C libraries for flight computers, and the proof that they are the same."""
