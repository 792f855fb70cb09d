# SPDX-License-Identifier: Apache-2.0
"""Papers flown again: figures and numbers beside those in print. Each paper is a package in this folder."""
