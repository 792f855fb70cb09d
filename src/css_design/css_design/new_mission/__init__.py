# SPDX-License-Identifier: Apache-2.0
"""From size, mass, faces, actuators and orbit to a mission that flies."""
