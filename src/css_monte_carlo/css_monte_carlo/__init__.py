# SPDX-License-Identifier: Apache-2.0
"""Flights in one process: single ones, and thousands of cases in one compiled loop; coverage of cell layouts."""
