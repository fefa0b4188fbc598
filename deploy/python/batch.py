"""Pulls at a block of each Young's modulus (Pa), on all cores, and prints the force.

On a cluster with Slurm, one modulus for each task of an array:

    sbatch --array=2000-8000:1000 --wrap 'python3 batch.py $SLURM_ARRAY_TASK_ID'
"""

import argparse
import multiprocessing
import pathlib

import trocar

SCENE = pathlib.Path(__file__).resolve().parent.parent / "scenes/pull.toml"
OLD = "young_modulus_pa = 4000"


def pull(modulus_pa):
    """Force that holds the top at the end, N, along y."""
    text = SCENE.read_text()
    assert OLD in text
    scenario = trocar.Scenario.parse(text.replace(OLD, f"young_modulus_pa = {modulus_pa}"), str(SCENE))
    return float(scenario.run().values["top_reaction"][-1, 1])


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modulus", type=float, nargs="+", help="Young's modulus, Pa")
    moduli = parser.parse_args().modulus
    with multiprocessing.Pool() as pool:
        for modulus, force in zip(moduli, pool.map(pull, moduli)):
            print(f"{modulus:8.0f} Pa {force:8.4f} N")


if __name__ == "__main__":
    main()
