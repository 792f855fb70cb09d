# SPDX-License-Identifier: Apache-2.0
"""The mission sections that this package brings; see `css_common.shared_sections`."""

from css_common.section import Section
from css_sensors import cells, payload, slits

SECTIONS: dict[str, Section] = {
    "cells": Section(cells.CELLS, cells.conflicts),
    "payload": Section(payload.PAYLOAD, payload.conflicts),
    "slits": Section(slits.SLITS, slits.conflicts),
}
