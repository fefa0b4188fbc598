"""Recordings for tests: a scenario of this folder, run by trocar-sim."""

import os
import pathlib
import subprocess


def record(name, folder):
    """The path of the recording of NAME.toml, made in a folder."""
    path = pathlib.Path(folder) / f"{name}.mcap"
    scene = pathlib.Path(__file__).with_name(f"{name}.toml")
    subprocess.run([os.environ["TROCAR_SIM"], scene, "--journal", path, "--out", folder], check=True,
                   stdout=subprocess.DEVNULL)
    return path
