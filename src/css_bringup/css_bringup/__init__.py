# SPDX-License-Identifier: Apache-2.0
"""Brings whole missions up: composed in one process, one process per node, launched, replayed, benchmarked."""
