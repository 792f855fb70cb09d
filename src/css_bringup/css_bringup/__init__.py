# SPDX-License-Identifier: Apache-2.0
"""Composes, supervises, launches, records and replays Sunpoint missions."""
