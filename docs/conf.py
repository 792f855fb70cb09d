# SPDX-License-Identifier: Apache-2.0
"""Settings of Sphinx. `./sunpoint docs` lays its source out and calls it; see src/css_docs."""

project = "Sunpoint"
author = "Sunpoint maintainers"
project_copyright = "Sunpoint maintainers, Apache-2.0"

extensions = ["myst_parser", "sphinx_copybutton", "css_docs.mathematics"]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
myst_links_external_new_tab = True
html_math_renderer = "mathml"
nitpicky = True

html_theme = "furo"
html_title = "Sunpoint"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
# The text of a hit would be fetched, which browsers refuse to pages that are files.
html_show_search_summary = False
pygments_style = "friendly"
copybutton_exclude = ".linenos, .gp, .go"
