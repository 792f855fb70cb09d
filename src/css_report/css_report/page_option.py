# SPDX-License-Identifier: Apache-2.0
"""The option of runs that end with a page; apart from what makes pages, so that help comes at once."""

import argparse


def add_page_option(parser: argparse.ArgumentParser) -> None:
    """Whether a run ends with a page."""
    parser.add_argument("--no-report", action="store_false", dest="report", help="end without writing a page")
