# SPDX-License-Identifier: Apache-2.0
"""No paper: what Sunpoint's own Sun filter attains where the papers' estimators end."""
