# SPDX-License-Identifier: Apache-2.0
"""Flights looked at afterwards: their logs, figures of merit, tables and plots."""
