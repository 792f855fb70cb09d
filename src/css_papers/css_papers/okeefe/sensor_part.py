# SPDX-License-Identifier: Apache-2.0
"""The part of the page that needs no flight: Figures 1b to 5b of O'Keefe & Schaub 2013 and their numbers."""

from pathlib import Path

from css_common.mission import Mission
from css_monte_carlo.coverage import grid_of, layout_of_mission, map_cells
from css_monte_carlo.coverage_figures import write_coverage_figures
from css_monte_carlo.coverage_statistics import coverage_object
from css_papers.cell_outputs import ARRAY, albedo_peaks, orbit_outputs, response
from css_papers.okeefe.cell_figures import write_orbit_outputs, write_reflectivity, write_response
from css_papers.okeefe.numbers import Peaks, albedo_rows, coverage_rows
from css_papers.page import Part, Picture, Section

_ATTITUDES = 60
_INCLINATIONS = {"a": 45.0, "b": 90.0}


def sensor_part(mission: Mission, folder: Path) -> Part:
    """Figs. 1b to 5b, which need no flight."""
    grid, layout = grid_of(mission), layout_of_mission(mission)
    ideal, warped = map_cells(layout, grid), map_cells(layout, grid, warp=True)
    normals_b = mission.values.cells.normals
    seen, error, error_warped = write_coverage_figures(grid, ideal, warped, normals_b, mission.name, folder)
    curve = write_response(response(mission), mission.values.cells.field_of_view_deg, folder / "figure_3.png")
    earth = write_reflectivity(mission, folder / "figure_4.png")
    pictures, peaks = [], []
    for letter, inclination in _INCLINATIONS.items():
        inclined = mission.with_overrides([f"orbit.inclination_deg={inclination:g}"])
        outputs = orbit_outputs(inclined)
        title = f"Cell output, inclination {inclination:g} deg"
        file = write_orbit_outputs(outputs, title, folder / f"figure_5{letter}.png")
        peaks.append(Peaks(outputs, albedo_peaks(inclined, _ATTITUDES)))
        pictures.append(Picture(file.name, f"Figure 5{letter}. {title}; cosine response, no degradation, no noise."))
    albedo = mission.node(ARRAY).values.albedo
    sections = [
        Section(
            "Cells",
            [
                Picture(seen.name, "Figure 1b. Number of cells that see the Sun."),
                Picture(error.name, "Figure 2. Error of the weighted average, cosine response."),
                Picture(error_warped.name, "Figure 2 again, with the warped response of Figure 3."),
                Picture(curve.name, "Figure 3. Response of a cell as it is simulated."),
            ],
        ),
        Section(
            "Light of the Earth",
            [
                "The paper does not say at which attitude its Figure 5 was taken. Here the spacecraft is fixed in "
                "inertial space with the array normal on the Sun, where the flights end, and body x in the plane of "
                "Sun and celestial pole: the Sun's part is constant, and what moves is the Earth's.",
                Picture(
                    earth.name,
                    f"Figure 4. Reflectivity in use: {albedo.reflectivity}, factor {albedo.factor:g}. The paper shows "
                    "the satellite data by latitude and longitude.",
                ),
                *pictures,
            ],
        ),
    ]
    return Part(sections, [*coverage_rows(coverage_object(grid, ideal, warped)), *albedo_rows(*peaks)])
