"""Presses the liver with a probe and prints force over depth; draws it with --plot FILE.

Needs numpy and trocar; --plot needs matplotlib.
"""

import argparse

import trocar


def press(organ, depths_m):
    """Force along the press, N, at each depth, m, after 0.1 s of rest there."""
    session = trocar.Session(organ)
    top = organ.nodes[organ.nodes[:, 2].argmax()]
    forces = []
    for depth in depths_m:
        session.put(0, top - [0, 0, depth], shaft=(0, 0, 1))
        session.step(100)
        forces.append(float(session.force()[2]))
    return forces


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--organ", default="liver", help="built-in organ or file [liver]")
    parser.add_argument("--steps", type=int, default=10, help="of 1 mm [10]")
    parser.add_argument("--plot", metavar="FILE", help="draws the curve (.png or .svg)")
    options = parser.parse_args()
    depths = [0.001 * step for step in range(-5, options.steps + 1)]
    forces = press(trocar.Organ(options.organ), depths)
    for depth, force in zip(depths, forces):
        print(f"{1e3 * depth:6.1f} mm {force:8.4f} N")
    if options.plot:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
        pyplot.plot([1e3 * d for d in depths], forces)
        pyplot.xlabel("depth, mm")
        pyplot.ylabel("force, N")
        pyplot.savefig(options.plot)


if __name__ == "__main__":
    main()
