# SPDX-License-Identifier: Apache-2.0
"""The Sun sensors of a spacecraft as its mission states them: what simulation and flight software both know of them."""
