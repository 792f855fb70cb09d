# SPDX-License-Identifier: Apache-2.0
"""Benton, Sun pointing in safe-hold with flat cells and with a collared pyramid of cells."""
