# SPDX-License-Identifier: Apache-2.0
"""Layouts of cells that spacecraft carry, as settings of the section `cells`."""

from okeefe_spacecraft import STATED

from css_papers.best.layouts import layouts

LAYOUTS = {"dual pyramid": {name: STATED[name] for name in STATED if name.startswith("cells__")}} | {
    name: {
        "cells__normals": layout.normals.ravel().tolist(),
        "cells__field_of_view_deg": layout.field_of_view_deg,
        "cells__clip_normal": [0.0, 0.0, 0.0],
    }
    for name, layout in layouts().items()
}
"""Dual pyramid of O'Keefe & Schaub, and those of the page on what the Sun filter attains."""
