# SPDX-License-Identifier: Apache-2.0
"""Looks at pages in a headless browser at three widths: cut or overlapping elements, complaints, time to open."""

import argparse
import sys
from pathlib import Path

from browser import NAMES, BrowserError, browser_path
from page_checks import WIDTHS, look_at


def main() -> int:
    """0: nothing is wrong with any page; 1: something is; 2: there is no browser or no page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", nargs="+", type=Path, metavar="PAGE", help="HTML files")
    parser.add_argument("--widths", nargs="+", type=int, default=WIDTHS, metavar="PX", help="default: 1400 800 390")
    parser.add_argument("--shots", type=Path, metavar="DIR", help="write a picture of each page at each width")
    parser.add_argument("--dark", action="store_true", help="as those who prefer dark pages see them")
    options = parser.parse_args()
    path = browser_path()
    missing = [page for page in options.pages if not page.is_file()]
    if path is None or missing:
        print(f"{missing[0]}: no such file" if missing else f"no browser here, looked for {', '.join(NAMES)}")
        return 2
    if options.shots:
        options.shots.mkdir(parents=True, exist_ok=True)
    wrong = 0
    for page in options.pages:
        print(f"{page}: {page.stat().st_size / 1e6:.1f} MB")
        for width in options.widths:
            try:
                seen = look_at(path, page, width, options.shots, dark=options.dark)
            except BrowserError as error:
                print(f"  {width} px: {error}")
                wrong += 1
                continue
            print(
                f"  {width} px: loaded after {seen.loaded_ms:.0f} ms, first plots after {seen.drawn_ms:.0f} ms, "
                f"{seen.cpu_s:.1f} s CPU, {seen.plots} plots, {len(seen.faults)} faults"
            )
            for fault in seen.faults:
                print(f"    {fault}")
            wrong += len(seen.faults)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
