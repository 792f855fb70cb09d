# SPDX-License-Identifier: Apache-2.0
"""Build rules: see `css_common.packaging`."""

from css_common.packaging import ros_package

ros_package(__file__)
