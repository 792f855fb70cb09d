# SPDX-License-Identifier: Apache-2.0
"""What commands do once their options are read: apart from these, for all that it takes is slow to load."""
