# SPDX-License-Identifier: Apache-2.0
"""Who may import whom: down only, never sideways. `docs/architecture.md` shows the same rooms."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from presence import present

SOURCES = Path(__file__).parents[1] / "src"

# Each may import what stands on a lower floor; rooms on one floor do not know each other.
FLOORS = (
    {"css_msgs"},
    {"css_common"},
    {"css_environment", "css_recording", "css_sensors"},
    {"css_sim", "css_estimation", "sunpoint_control", "css_drivers", "css_telemetry"},
    {"css_analysis"},
    {"css_report", "css_viewers"},
    {"css_bringup", "css_monte_carlo"},
    {"css_papers", "css_design", "css_calibration", "css_export", "css_console"},
    {"css_docs"},
)
# rooms inside css_estimation, and which others each may enter: an attitude filter needs to know the cells, the Sun
# filter is a Sun estimator and gives an attitude
WINGS = {"sun": set(), "spin": set(), "attitude": {"sun"}, "sun_filter": {"sun", "attitude"}}
# inside a package, nodes and commands are the roof
ROOFS = {"nodes", "commands"}
FLOOR_OF = {package: number for number, packages in enumerate(FLOORS) for package in packages}
PACKAGES = sorted(path.parent.name for path in SOURCES.glob("*/package.xml"))
ROS = {"rclpy"}
# the only modules that may know ROS: they put components on it
ON_ROS = {"css_common", "css_recording", "css_bringup", "css_console"}


def modules() -> Iterator[tuple[str, ast.Module]]:
    for package in PACKAGES:
        for file in sorted((SOURCES / package / package).rglob("*.py")):
            name = ".".join((package, *file.relative_to(SOURCES / package / package).with_suffix("").parts))
            yield name.removesuffix(".__init__"), ast.parse(file.read_text(encoding="utf-8"))


def imports(tree: ast.Module) -> Iterator[str]:
    """Full names of everything that is imported anywhere in a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


MODULES = dict(modules())
GRAPH = {name: sorted(set(imports(tree))) for name, tree in MODULES.items()}


def test_every_package_has_its_floor():
    assert set(PACKAGES) == set(FLOOR_OF)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_what_stands_below_it(package):
    wrong = [
        f"{module} imports {name}"
        for module, names in GRAPH.items()
        if module.split(".")[0] == package
        for name in names
        for other in [name.split(".")[0]]
        if other in FLOOR_OF and other != package and FLOOR_OF[other] >= FLOOR_OF[package]
    ]
    assert wrong == []


def test_a_package_declares_what_it_imports():
    wrong = []
    for module, names in GRAPH.items():
        package = module.split(".")[0]
        manifest = (SOURCES / package / "package.xml").read_text(encoding="utf-8")
        for other in {name.split(".")[0] for name in names} & set(FLOOR_OF) - {package}:
            if f"<depend>{other}</depend>" not in manifest:
                wrong.append(f"{package}/package.xml does not name {other}, which {module} imports")
    assert wrong == []


def test_rooms_of_the_estimators():
    wrong = []
    for module, names in GRAPH.items():
        wing = module.split(".")[1] if module.startswith("css_estimation.") else ""
        barred = set(WINGS) - {wing} - WINGS.get(wing, set(WINGS))
        entered = {name: name.split(".")[1] for name in names if name.startswith("css_estimation.")}
        wrong += [f"{module} imports {name}" for name, room in entered.items() if room in barred]
    assert wrong == []


def test_algorithms_do_not_know_their_nodes():
    wrong = [
        f"{module} imports {name}"
        for module, names in GRAPH.items()
        if ROOFS.isdisjoint(module.split("."))
        for name in names
        if name.split(".")[0] == module.split(".")[0] and not ROOFS.isdisjoint(name.split("."))
    ]
    assert wrong == []


def test_no_paper_imports_another():
    papers = {file.parent.name for file in (SOURCES / "css_papers" / "css_papers").glob("*/paper.py")}
    wrong = [
        f"{module} imports {name}"
        for module, names in GRAPH.items()
        if module.startswith("css_papers.") and module.split(".")[1] in papers
        for name in names
        if name.startswith("css_papers.") and name.split(".")[1] in papers - {module.split(".")[1]}
    ]
    assert len(papers) >= 4
    assert wrong == []


def at_import(tree: ast.Module) -> ast.Module:
    """What runs when a module is imported: no bodies of functions, nothing for type checkers alone."""
    kept = [n for n in tree.body if not (isinstance(n, ast.If) and "TYPE_CHECKING" in ast.unparse(n.test))]
    kept = [n for n in kept if not isinstance(n, ast.FunctionDef | ast.ClassDef)]
    return ast.Module(kept, [])


def test_there_is_no_circle():
    graph = {name: sorted(set(imports(at_import(tree)))) for name, tree in MODULES.items()}
    packages = {name for name in MODULES if any(other.startswith(f"{name}.") for other in MODULES)}
    leaf = {
        module: {n for i in names for n in (i, i.rpartition(".")[0]) if n in MODULES and n not in packages | {module}}
        for module, names in graph.items()
    }
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path, module))
        if module not in done:
            for other in sorted(leaf[module]):
                visit(other, (*path, module))
            done.add(module)

    for module in sorted(MODULES):
        visit(module, ())


def test_ros_stays_with_those_who_put_components_on_it():
    wrong = [
        f"{module} imports {name}"
        for module, names in GRAPH.items()
        if module.split(".")[0] not in ON_ROS
        for name in names
        if name.split(".")[0] in ROS
    ]
    assert wrong == []


def private_names(tree: ast.Module) -> Iterator[str]:
    """Names that begin with an underscore and belong to somebody else."""
    own = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and ast.unparse(n.value) in ("self", "cls")}
    own |= {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}
    public_all_the_same = {"_replace", "_fields", "_asdict", "_field_defaults", "_exit"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in (*ROS, "numba"):
            yield from (
                n for n in (*present(node.module).split("."), *(a.name for a in node.names)) if n.startswith("_")
            )
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            yield from () if node.attr in own | public_all_the_same else (ast.unparse(node),)


def test_what_is_not_public_in_rclpy_or_numba_is_taken_in_one_place_each():
    found = {m: list(private_names(tree)) for m, tree in MODULES.items() if m.split(".")[0] in ON_ROS}
    assert len(found.pop("css_common.ros_internals")) >= 5
    assert len(found.pop("css_common.linked_code")) >= 3
    assert found.pop("css_common.boxed_tuples") == ["_boxers"]
    assert {module: names for module, names in found.items() if names} == {}


def test_all_packages_have_one_version_which_the_changelog_knows():
    manifests = {path: path.read_text(encoding="utf-8") for path in SOURCES.glob("*/package.xml")}
    (version,) = {present(re.search(r"<version>(.*?)</version>", text))[1] for text in manifests.values()}
    assert f"\n## {version}\n" in (SOURCES.parent / "CHANGELOG.md").read_text(encoding="utf-8")
