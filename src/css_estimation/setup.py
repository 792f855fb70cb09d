# SPDX-License-Identifier: Apache-2.0
"""Build rules: every file in `nodes/` and `commands/` becomes an executable of its name."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "css_estimation"
EXECUTABLES = [
    f"{file.stem} = css_common.entry:main"
    for folder in ("nodes", "commands")
    for file in sorted(Path(PACKAGE, folder).glob("[a-z]*.py"))
]

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["data/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    entry_points={"console_scripts": EXECUTABLES},
    zip_safe=False,
    maintainer="Sunpoint maintainers",
    maintainer_email="maintainers@sunpoint.dev",
    description="Sun-heading and attitude estimators on coarse sun sensor outputs.",
    license="Apache-2.0",
)
