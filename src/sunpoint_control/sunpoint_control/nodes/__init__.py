# SPDX-License-Identifier: Apache-2.0
"""One executable a file: which topics, which messages. What is computed is in the modules beside this folder."""
