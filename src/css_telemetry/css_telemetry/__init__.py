# SPDX-License-Identifier: Apache-2.0
"""Tables of telemetry as people have them, read by a description and turned into recordings."""
