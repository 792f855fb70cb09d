# SPDX-License-Identifier: Apache-2.0
"""One executable a file: the truth and its sensors. What is computed is in the modules one level up."""
