# SPDX-License-Identifier: Apache-2.0
"""A made-up package of components for the tests."""
