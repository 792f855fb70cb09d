# SPDX-License-Identifier: Apache-2.0
"""What tests of imports share."""

from mcap_doctor import doctor as doctor
