"""Reads the tools of a recording into pandas and prints the force on each, N, over all frames.

Needs trocar and pandas (python3-pandas); without pandas it says so and exits with 5.
"""

import argparse
import sys

import trocar


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", help="file of a session (.mcap)")
    options = parser.parse_args()
    try:
        import pandas
    except ImportError:
        print("read_recording: skipped: pandas is missing, install python3-pandas", file=sys.stderr)
        return 5
    with trocar.Recording(options.recording) as recording:
        table = pandas.DataFrame(recording.tools())
    table["force_n"] = (table[["fx_n", "fy_n", "fz_n"]] ** 2).sum(axis=1) ** 0.5
    print("Force of the tissue on each tool, N, frame by frame")
    print(table.groupby("tool")["force_n"].describe())
    return 0


if __name__ == "__main__":
    sys.exit(main())
