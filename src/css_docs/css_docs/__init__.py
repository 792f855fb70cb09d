# SPDX-License-Identifier: Apache-2.0
"""The documentation as a site: pages as they lie in the repository, reference and figures made from the code."""
