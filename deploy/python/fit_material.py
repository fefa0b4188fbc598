"""Fits Young's modulus to a measured curve and prints it, as `trocar-organ fit` does.

The scenario makes the same test as the machine did; Gauss-Newton changes the modulus until its forces
agree best (least squares). Needs numpy and trocar; --plot needs matplotlib.
"""

import argparse
import pathlib
import re

import numpy
import trocar

SCENES = pathlib.Path(__file__).resolve().parent.parent / "scenes"
TRAVEL_MM = 8  # of the plate in stretch.toml, evenly over its run


def pull(scenario, modulus_pa, travel_mm):
    """Forces on the plate, N, where it has gone each of travel_mm."""
    text = re.sub(r"young_modulus_pa = \S+", f"young_modulus_pa = {modulus_pa!r}", scenario.read_text())
    text = re.sub(r"load_steps = \d+", "load_steps = 16", text)
    test = trocar.Scenario.parse(text, str(scenario))
    result = test.run(solver="full")
    times, forces = result.times["plate_reaction"], result.values["plate_reaction"][:, 1]
    at = TRAVEL_MM * times / test.seconds
    return numpy.interp(travel_mm, numpy.append(0, at), numpy.append(0, forces))


def fit(scenario, travel_mm, measured_n, modulus_pa, step=0.02, runs=20):
    """The modulus and its standard error, Pa, and the forces that it gives, N."""
    for _ in range(runs):
        forces = pull(scenario, modulus_pa, travel_mm)
        slope = (pull(scenario, modulus_pa * (1 + step), travel_mm) - forces) / (modulus_pa * step)
        change = slope @ (measured_n - forces) / (slope @ slope)
        if abs(change) < 1e-4 * modulus_pa:
            break
        modulus_pa = max(modulus_pa + change, 0.1 * modulus_pa)
    variance = ((measured_n - forces) ** 2).sum() / (len(measured_n) - 1)
    return float(modulus_pa), float(numpy.sqrt(variance / (slope @ slope))), forces


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--curve", default=SCENES / "stretch.csv", type=pathlib.Path,
                        help="columns displacement_mm and force_n [of deploy/scenes]")
    parser.add_argument("--start", type=float, default=4000, help="modulus to begin with, Pa [4000]")
    parser.add_argument("--plot", metavar="FILE", help="draws both curves (.png or .svg)")
    options = parser.parse_args()
    rows = [line for line in options.curve.read_text().splitlines() if not line.startswith("#")]
    travel, measured = numpy.loadtxt(rows, delimiter=",", skiprows=1, unpack=True)
    modulus, error, forces = fit(SCENES / "stretch.toml", travel, measured, options.start)
    print(f"Young's modulus {modulus:.0f} Pa, standard error {error:.0f} Pa")
    if options.plot:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
        pyplot.plot(travel, measured, "o", label="measured")
        pyplot.plot(travel, forces, label=f"{modulus:.0f} Pa")
        pyplot.xlabel("travel of the plate, mm")
        pyplot.ylabel("force, N")
        pyplot.legend()
        pyplot.savefig(options.plot)


if __name__ == "__main__":
    main()
