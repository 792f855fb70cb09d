# SPDX-License-Identifier: Apache-2.0
"""Nodes, from the components that they are: topics, parameters and faults as these declare them."""

from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from css_common.component import INERTIAL, Component, Input, Output
from css_common.mission_file import MissionError
from css_common.node_files import find_component
from css_common.readme_parameters import FAULT_HEADER, HEADER, fault_row, row
from css_common.schema import Values, default_values
from css_common.shared_sections import shared_sections
from css_docs.links import relative
from css_docs.reference import messages
from css_docs.reference.text import contents, paragraphs, plain, table
from css_docs.staging import REPOSITORY

FOLDER = PurePosixPath("reference", "nodes")
KEYS = PurePosixPath("reference", "mission_keys.md")


def node_files(root: Path) -> list[tuple[str, str]]:
    """Package and name of every node file."""
    files = sorted(root.glob("src/*/*/nodes/[a-z]*.py"))
    return [(file.parts[-3], file.stem) for file in files if file.parts[-3] == file.parts[-4]]


def components(root: Path) -> dict[tuple[str, str], type[Component]]:
    """Components by package and name of their node file; recorder and player are none."""
    found = {}
    for package, name in node_files(root):
        try:
            found[package, name] = find_component(package, name)
        except MissionError:
            continue
    return found


def page_of(package: str, name: str) -> PurePosixPath:
    """The page of a node."""
    return FOLDER / package / f"{name}.md"


def pages(root: Path, algorithms: Mapping[str, Mapping[str, PurePosixPath]]) -> Iterator[tuple[PurePosixPath, str]]:
    """A page for each node, and one that lists them.

    Args:
        algorithms: pages of algorithms, by their titles, by the name `PACKAGE/NODE` of those who run them.
    """
    kinds = components(root)
    rows, listed = [], []
    for package, name in node_files(root):
        page = page_of(package, name)
        kind = kinds.get((package, name))
        known = algorithms.get(f"{package}/{name}", {})
        yield page, _component_page(kind, page, known) if kind else _verb_page(package, name, root)
        purpose = _first_line(kind.__doc__) if kind else _verb_summary(package, name, root)
        rows.append((f"[`{package} {name}`]({package}/{name}.md)", plain(purpose)))
        listed.append(f"{package}/{name}")
    hidden = contents(listed).replace(":maxdepth", ":hidden:\n:maxdepth")
    yield (
        FOLDER / "index.md",
        f"# Nodes\n\nEach is a lifecycle node, started by `ros2 run PACKAGE NODE` or named in `graph.nodes` of a "
        f"mission. Topics are those with the defaults of its parameters; those with every flag on are marked.\n\n"
        f"{table(('node', 'what it does'), rows)}\n{hidden}",
    )


def _first_line(text: str | None) -> str:
    return (text or "").strip().splitlines()[0] if text else ""


def _component_page(kind: type[Component], page: PurePosixPath, algorithms: Mapping[str, PurePosixPath]) -> str:
    package, _, name = kind.__module__.partition(".nodes.")
    source = f"src/{package}/{package}/nodes/{name}.py"
    parts = [f"# {package} {name}\n\n{paragraphs(kind.__doc__)}\n"]
    if algorithms:
        links = ", ".join(f"[{title}]({relative(page, path)})" for title, path in algorithms.items())
        parts.append(f"Algorithms: {links}.\n")
    parts.append(f"    ros2 run {package} {name} --ros-args --params-file MISSION.yaml\n")
    parts.append(f"## Topics\n\n{_topics(kind, name, page)}")
    parts.append(_quality())
    parts.append(f"## Parameters\n\n{_parameters(kind, page)}")
    if kind.fault_kinds:
        rows = "\n".join(fault_row(fault) for fault in kind.fault_kinds)
        parts.append("## Faults of its units\n\n" + "\n".join(FAULT_HEADER) + f"\n{rows}\n")
    parts.append(f"Source: [{source}]({REPOSITORY}{source}). Exit codes: 0 told to end, or the flight is over; 1 it "
                 "failed; 2 something given is wrong.\n")  # fmt: skip
    return "\n".join(parts)


def _topics(kind: type[Component], name: str, page: PurePosixPath) -> str:
    plain_values = default_values(kind.table())
    flags = {p.name.replace(".", "__"): True for p in kind.table() if p.kind == "flag"}
    every = default_values(kind.table(), **flags)
    rows: dict[tuple[str, str], tuple[str, ...]] = {}
    for values, remark in ((plain_values, ""), (every, "with a flag on")):
        for way, ports in (("hears", kind.inputs(name, values)), ("publishes", kind.outputs(name, values))):
            for port in ports:
                rows.setdefault((way, port.topic), _topic(way, port, values, page, remark))
    rows["publishes", "/diagnostics"] = ("publishes", "`/diagnostics`", "`diagnostic_msgs/DiagnosticArray`", "", "")
    return table(("", "topic", "message", "`frame_id`", "notes"), rows.values())


def _topic(way: str, port: Input | Output, values: Values, page: PurePosixPath, remark: str) -> tuple[str, ...]:
    frame = values.io.inertial_frame if port.frame == INERTIAL else values.io.body_frame
    notes = [remark]
    if isinstance(port, Input):
        notes += ["optional" if not port.required else "", f"used: {', '.join(port.used)}" if port.used else ""]
        frame = port.sensor_frame or frame
    else:
        notes += ["ends the cycle" if port.ends_cycle else "", "any number a step" if port.events else ""]
    if port.divider > 1:
        notes.append(f"every {port.divider} cycles")
    return way, f"`{port.topic}`", messages.link(port.message_type, page), f"`{frame}`", "; ".join(filter(None, notes))


def _quality() -> str:
    """Quality of service of all nodes alike; nothing where there is no ROS, which has the words for it."""
    try:
        from css_common.qos import LOOP_PUBLISHER, LOOP_SUBSCRIPTION
    except ModuleNotFoundError:
        return ""

    def words(profile: object) -> str:
        policies = [profile.reliability, profile.durability]  # type: ignore[attr-defined]
        return ", ".join(policy.name.lower() for policy in policies)

    return (
        f"Quality of service: publishers {words(LOOP_PUBLISHER)}; subscriptions {words(LOOP_SUBSCRIPTION)}, less where "
        "the first writer offers less.\n"
    )


def _parameters(kind: type[Component], page: PurePosixPath) -> str:
    section_of = {p.name: name for name, section in shared_sections().items() for p in section.table}
    own = [p for p in kind.table() if p.name not in section_of]
    rows = "\n".join((*HEADER, *map(row, own)))
    names = dict.fromkeys(section_of[p.name] for p in kind.table() if p.name in section_of)
    shared = ", ".join(f"[`{name}`]({relative(page, KEYS)}#{name})" for name in names)
    text = f"A star: it may change in flight (`ros2 param set`, an event).\n\n{rows}\n" if own else ""
    return f"{text}\nShared sections of the mission that it reads: {shared}.\n"


def _verb_of(package: str, name: str, root: Path) -> str:
    from css_docs.reference.verbs import table_of_verbs

    verbs = table_of_verbs(root).VERBS
    return next(verb for verb, entry in verbs.items() if (entry.package, entry.executable) == (package, name))


def _verb_summary(package: str, name: str, root: Path) -> str:
    from css_docs.reference.verbs import table_of_verbs

    return table_of_verbs(root).VERBS[_verb_of(package, name, root)].summary


def _verb_page(package: str, name: str, root: Path) -> str:
    verb = _verb_of(package, name, root)
    return (
        f"# {package} {name}\n\n{plain(_verb_summary(package, name, root))}. Its options are those of the verb "
        f"[`{verb}`](../../verbs/{verb}.md); it takes topics of any type, as the serialised bytes that they are.\n"
    )
