# SPDX-License-Identifier: Apache-2.0
"""No component here."""
