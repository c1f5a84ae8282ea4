"""Kohout and Červenka 2021, Fig. 11: volume over hip flexion, 3 iterations."""

from __future__ import annotations

from common import LEFT, MODELS, Case, Table, angles_up_to, curves, main, value

ITERATIONS = 3


def tables(case: Case) -> list[Table]:
    """Return the largest error of each muscle's volume, and its longest edge."""
    columns = ("muscle", "published [%]", *(f"{model} [%]; longest edge" for model in MODELS))
    table = Table("Fig. 11: largest error of the volume, 0 to 90 degrees", columns)
    angles = angles_up_to(6.0 if case.short else 90.0)
    figure, axes = curves("Kohout 2021, Fig. 11", "flexion from rest [degrees]", "volume / volume at rest")
    for name in case.muscles:
        cells = []
        for model, chain in case.chains(name, ITERATIONS, measure_shape=True).items():
            ratios, longest = [], 1.0
            for angle in angles:
                pose = chain.pose(angle)
                if pose is None:
                    break
                ratios.append(value(pose[1], "VolumeRatio"))
                longest = max(longest, value(pose[1], "EdgeStretchMax"))
            worst = f"{100.0 * max(abs(ratio - 1.0) for ratio in ratios):.1e}; {longest:.3g}"
            cells.append(worst + (f"; {LEFT} at {angle:g} degrees" if len(ratios) < len(angles) else ""))
            axes.plot(angles[: len(ratios)], ratios, label=f"{name}, {model}")
        table.add(name, "< 1", *cells)
    if case.out is not None:
        axes.set_ylim(0.98, 1.02)
        axes.legend(fontsize=7)
        case.save(figure, "kohout2021_fig11.png")
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
