# SPDX-License-Identifier: Apache-2.0
"""One executable a file: which algorithm, which topics. What is computed is in the modules beside this folder."""
