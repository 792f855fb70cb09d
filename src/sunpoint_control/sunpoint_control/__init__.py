# SPDX-License-Identifier: Apache-2.0
"""MRP sun-pointing control, wheel allocation, momentum dumping and control modes."""
