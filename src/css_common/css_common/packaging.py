# SPDX-License-Identifier: Apache-2.0
"""Build rules of every Python package: what differs stands in its package.xml.

Standard library and setuptools only: `setup.py` runs it before anything is installed.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

from setuptools import find_packages, setup

from css_common.places import SECTIONS_INDEX


def ros_package(
    setup_file: str,
    data_files: Sequence[tuple[str, list[str]]] = (),
    *,
    sections: bool = False,
    plugins: Mapping[str, list[str]] | None = None,
) -> None:
    """Declares the package of a `setup.py`: every file in `nodes/` and `commands/` is an executable of its name.

    Args:
        setup_file: `__file__` of the `setup.py`, beside which package.xml lies.
        data_files: further files, as setuptools takes them; `{share}` is the package's folder of data.
        sections: the package brings mission sections (`SECTIONS` in its module `sections`).
        plugins: what it offers to packages that do not import it, entry points by their group.
    """
    folder = Path(setup_file).parent
    manifest = ET.parse(folder / "package.xml").getroot()
    told = {name: (manifest.findtext(name) or "").strip() for name in ("name", "version", "description", "license")}
    maintainer = manifest.find("maintainer")
    assert maintainer is not None
    package, share = told["name"], f"share/{told['name']}"
    setup(
        **told,
        maintainer=maintainer.text,
        maintainer_email=maintainer.get("email"),
        packages=find_packages(exclude=["test"]),
        package_data={package: ["data/*"]},
        data_files=[
            ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
            (share, ["package.xml"]),
            *([(SECTIONS_INDEX, [f"resource/{package}"])] if sections else []),
            *((place.format(share=share), files) for place, files in data_files),
        ],
        entry_points={"console_scripts": _executables(folder / package), **(plugins or {})},
        zip_safe=False,
    )


def _executables(module: Path) -> list[str]:
    files = (file for kind in ("nodes", "commands") for file in sorted((module / kind).glob("[a-z]*.py")))
    return [f"{file.stem} = css_common.entry:main" for file in files]
