# SPDX-License-Identifier: Apache-2.0
"""A spacecraft of your own: missions from a few numbers, and what will limit their pointing."""
