"""Draws a scalpel through the plate and prints the nodes that the cut made and how hard it was."""

import argparse

import trocar


def cut(organ, length_m, speed_m_s=0.05):
    """Nodes that were made, and the greatest force on the blade, N."""
    session = trocar.Session(organ)
    session.take(0, form="scalpel", radius=0.001, edge=0.02)
    before = len(session.positions)
    ticks = int(1000 * length_m / speed_m_s)
    most = 0.0
    session.put(0, (-length_m / 2, 0.03, 0), "none")
    session.step(20)
    for tick in range(0, ticks, 8):
        x = -length_m / 2 + length_m * tick / ticks
        session.put(0, (x, -0.006, 0), "cut")
        session.step(8)
        most = max(most, float((session.force() ** 2).sum() ** 0.5))
    return len(session.positions) - before, most


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--length", type=float, default=0.04, help="m [0.04]")
    nodes, force = cut(trocar.Organ("plate"), parser.parse_args().length)
    print(f"{nodes} nodes made, at most {force:.3f} N")


if __name__ == "__main__":
    main()
