# SPDX-License-Identifier: Apache-2.0
"""O'Keefe & Schaub, "Sun heading estimation using underdetermined set of coarse sun sensors", AAS 13-891 (2013)."""
