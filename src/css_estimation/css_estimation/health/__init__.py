# SPDX-License-Identifier: Apache-2.0
"""What the spacecraft thinks of its own sensors: which are held for failed, and what estimators are given instead."""
