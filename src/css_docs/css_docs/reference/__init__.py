# SPDX-License-Identifier: Apache-2.0
"""Pages of the reference, from the tables that the code itself is run by."""
