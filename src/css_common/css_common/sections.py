# SPDX-License-Identifier: Apache-2.0
"""Mission sections that any mission may have, with the checks that one value alone cannot pass or fail.

They stand under `/**` in a mission file, like those that other packages bring (`css_common.shared_sections`). Defaults
are nobody's spacecraft: what no two have in common is empty until a mission says it, and components that need it ask
for it (`Component.needed`).
"""

from collections.abc import Iterator

import numpy as np

from css_common import actuator_sections, mission_section, orbit_section
from css_common.codec import MAX_FRAME
from css_common.link_kinds import LINK_FAULTS
from css_common.schema import Table, Values, choice, flag, integer, real, reals, text, texts
from css_common.section import Section

INERTIA = reals(
    "spacecraft.inertia",
    (),
    "kg m^2",
    "inertia matrix about the centre of mass, wheels included, row-major",
    length=9,
    columns=3,
    example="spacecraft: {inertia: [10.5, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 6.75]}",
)
ARRAY_NORMAL = reals("spacecraft.array_normal", (0.0, 0.0, 1.0), "-", "normal of the solar arrays in b", length=3)

SPACECRAFT: Table = (
    INERTIA,
    ARRAY_NORMAL,
)

FIELD_DIVIDER = integer(
    "magnetometer.divider", 1, "steps", "a measurement is due every so many steps", low=1, high=100000
)

MEASURED_FIELD_BIAS = reals(
    "magnetometer.measured.bias_nt", (), "nT", "bias of the magnetometer, as calibrated; empty: none", columns=3
)
MEASURED_FIELD_MATRIX = reals(
    "magnetometer.measured.matrix",
    (),
    "-",
    "what the magnetometer makes of a field besides its bias, as calibrated, row-major; empty: the field itself",
    columns=3,
)
MEASURED_GYRO_BIAS = reals(
    "gyro.measured.bias_deg_h", (), "deg/h", "bias of the gyro, as calibrated; empty: none", columns=3
)

MAGNETOMETER: Table = (FIELD_DIVIDER, MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX)

GYRO: Table = (MEASURED_GYRO_BIAS,)

MEASURES: Table = (
    real(
        "measures.settled_time", 0.0, "s", "from the epoch, after which an attitude filter counts as settled", low=0.0
    ),
    real(
        "measures.late_time",
        0.0,
        "s",
        "sunlit time at the end of a flight whose mean heading error studies state; 0: they do not",
        low=0.0,
    ),
    real(
        "measures.report_time",
        0.0,
        "s",
        "time from the epoch at which studies state the body rate and its error; 0: they do not",
        low=0.0,
    ),
    real(
        "measures.detumbled_rate_deg_s",
        0.0,
        "deg/s",
        "body rate below which a spacecraft counts as detumbled; 0: detumbling is not measured",
        low=0.0,
        high=360.0,
    ),
    real(
        "measures.required_share",
        0.0,
        "-",
        "share of the cases of a study that must meet the criteria; 0: criteria judge flights alone",
        low=0.0,
        high=1.0,
    ),
)

SAMPLING: Table = (
    choice(
        "sampling.method",
        "random",
        ("random", "lhs", "sobol", "saltelli"),
        "how dispersed parameters are drawn over the cases of a study",
    ),
    integer(
        "sampling.cases",
        0,
        "-",
        "cases that a Latin hypercube is spread over, or base points of a Saltelli design",
        low=0,
        high=2**24,
    ),
)

GRAPH: Table = (
    texts(
        "graph.nodes",
        (),
        "nodes of the graph as PACKAGE/EXECUTABLE, or PACKAGE/EXECUTABLE:NAME for a second one of a kind",
    ),
    text("graph.estimator", "ekf", "name of the Sun estimator that the control listens to"),
)

LOCKSTEP: Table = (
    texts("lockstep.wait_for", (), "topics that dynamics waits for; empty: commands and all estimates"),
    real("lockstep.realtime_factor", 0.0, "-", "pace against the wall clock; 0: as fast as it goes", low=0.0),
    real("lockstep.warn_after", 2.0, "s", "wall time of silence before the missing topic is named", low=0.05),
    real(
        "lockstep.hold_limit",
        30.0,
        "s",
        "wall time of silence before the flight goes on without the partner, actuators at rest",
        low=0.1,
    ),
    flag("lockstep.publish_clock", False, "also publish simulated time on /clock, for tools that follow it"),
    flag("lockstep.wait_for_recorder", False, "hold the flight when its recorder falls behind"),
    integer("lockstep.recorders", 0, "-", "recorders that must be listening before the first step", low=0, high=16),
    real("lockstep.startup_limit", 180.0, "s", "wall time allowed for all partners to appear", low=0.1),
)

IO: Table = (
    choice(
        "io.input_matching",
        "exact",
        ("exact", "latest"),
        "exact: inputs of one stamp belong together; latest: the newest of each, for devices with own clocks",
    ),
    real("io.deadline", 0.5, "s", "age at which an input counts as silent", low=0.001, high=1e9, tunable=True),
    text("io.body_frame", "bus", "frame_id of body-frame messages"),
    text("io.inertial_frame", "eci", "frame_id of inertial messages"),
    texts("io.accepted_frames", (), "further frame_ids taken for the expected one, as hardware drivers name them"),
    choice(
        "io.writers",
        "first",
        ("first", "graph"),
        "whose messages are taken: first: one writer a topic until it is gone, the mission's own before others; "
        "graph: only the node that the mission names for a topic",
    ),
    LINK_FAULTS,
    real("io.largest_gap", 60.0, "s", "a stamp further ahead than this must be confirmed", low=0.001, high=1e9),
    flag("autostart", True, "configure and activate without being asked"),
)


def _magnetometer_conflicts(magnetometer: Values) -> Iterator[str]:
    measured = magnetometer.measured
    if len(measured.bias_nt) not in (0, 1):
        yield f"magnetometer.measured.bias_nt: {3 * len(measured.bias_nt)} numbers given, expected three or none"
    if not len(measured.matrix):
        return
    if len(measured.matrix) != 3:
        yield f"magnetometer.measured.matrix: {3 * len(measured.matrix)} numbers given, expected nine or none"
    elif abs(np.linalg.det(measured.matrix)) < 1e-3:
        yield "magnetometer.measured.matrix: singular, expected one near the identity"


def _gyro_conflicts(gyro: Values) -> Iterator[str]:
    if len(gyro.measured.bias_deg_h) not in (0, 1):
        yield f"gyro.measured.bias_deg_h: {3 * len(gyro.measured.bias_deg_h)} numbers given, expected three or none"


def _io_conflicts(io: Values) -> Iterator[str]:
    for key in ("body_frame", "inertial_frame"):
        if len(getattr(io, key).encode()) >= MAX_FRAME:
            yield f"io.{key}: expected a name shorter than {MAX_FRAME} bytes"


def _spacecraft_conflicts(spacecraft: Values) -> Iterator[str]:
    if len(spacecraft.inertia):
        yield from _inertia_conflicts(spacecraft.inertia)
    length = np.linalg.norm(spacecraft.array_normal)
    if abs(length - 1.0) > 1e-6:
        yield f"spacecraft.array_normal: length {length:.6g} given, expected a unit vector"


def _inertia_conflicts(inertia: np.ndarray) -> Iterator[str]:
    if not np.allclose(inertia, inertia.T, rtol=1e-12, atol=0.0):
        yield "spacecraft.inertia: not symmetric, expected a symmetric positive definite matrix"
        return
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0.0:
        yield f"spacecraft.inertia: eigenvalue {moments[0]:.6g} given, expected a positive definite matrix"
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        yield (
            f"spacecraft.inertia: principal moments {', '.join(f'{m:.6g}' for m in moments)} break the triangle "
            "inequality, no rigid body has them"
        )


SECTIONS: dict[str, Section] = {
    **mission_section.SECTIONS,
    **orbit_section.SECTIONS,
    "spacecraft": Section(SPACECRAFT, _spacecraft_conflicts),
    **actuator_sections.SECTIONS,
    "magnetometer": Section(MAGNETOMETER, _magnetometer_conflicts),
    "gyro": Section(GYRO, _gyro_conflicts),
    "measures": Section(MEASURES),
    "sampling": Section(SAMPLING),
    "graph": Section(GRAPH),
    "lockstep": Section(LOCKSTEP),
    "io": Section(IO, _io_conflicts),
}
