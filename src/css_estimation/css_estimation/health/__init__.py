# SPDX-License-Identifier: Apache-2.0
"""Which sensors can be trusted: what stands between them and every Sun estimator."""
