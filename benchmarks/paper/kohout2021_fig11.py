"""Kohout and Červenka 2021, Fig. 11: volume over hip flexion, 3 iterations."""

from __future__ import annotations

from common import AS_PUBLISHED, LEFT, Case, Table, angles_up_to, main, value

from vtkmuscle.plotting.sheets import curves

ITERATIONS = 3


def tables(case: Case) -> list[Table]:
    """Return the largest error of each muscle's volume."""
    columns = ("muscle", "published [%]", "published settings [%]", "defaults, 3 iterations [%]")
    table = Table("Fig. 11: largest error of the volume, 0 to 90 degrees", columns)
    angles = angles_up_to(6.0 if case.short else 90.0)
    ratios = {}
    for name in case.muscles:
        errors = []
        for title, settings in (("published settings", AS_PUBLISHED), ("defaults", {})):
            chain = case.chain(name, iterations=ITERATIONS, **settings)
            found = []
            for angle in angles:
                pose = chain.pose(angle)
                if pose is None:
                    break
                found.append(value(pose[1], "VolumeRatio"))
            ratios[name, title] = found
            worst = f"{100.0 * max(abs(ratio - 1.0) for ratio in found):.1e}"
            errors.append(worst + (f"; {LEFT} at {angle:g} degrees" if len(found) < len(angles) else ""))
        table.add(name, "< 1", *errors)
    if case.out is not None:
        figure, axes = curves(
            "Kohout 2021, Fig. 11", "flexion from rest [degrees]", "volume / volume at rest"
        )
        for (name, title), found in ratios.items():
            axes.plot(
                angles[: len(found)], found, "-" if title == "defaults" else "--", label=f"{name}, {title}"
            )
        axes.set_ylim(0.98, 1.02)
        axes.legend(fontsize=7)
        case.save(figure, "kohout2021_fig11.png")
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
