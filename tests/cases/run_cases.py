#!/usr/bin/env python3
"""Imports the files of a folder of cases from use, cuts in its scenes, and checks what comes out of each.

    run_cases.py BIN SHARED

BIN has trocar-organ and trocar-sim; SHARED, or the folder of the variable TROCAR_SHARED, has cases with meshes,
surfaces, scans and scenes of cutting.
Exit code: 1 if a case comes out otherwise, 77 if they are not there.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

# File, options, exit code, what the program says (regular expressions), volumes of regions in ml.
CASES = [
    ("meshes/cyst.inp", "--unit mm", 0, ["'LEFT_LOBE: 36 of 72'"], {"LEFT_LOBE": 6, "RIGHT_LOBE": 12, "CYST": 6}),
    ("meshes/vessel.msh", "--unit mm", 0, [], {"lumen": 3.024, "wall": 8.208, "tissue": 21.168}),
    ("meshes/two-groups.msh", "--unit mm --fix set:capsule", 0, ["fixed nodes +150 "], {}),
    ("meshes/whole-and-lobes.msh", "--unit mm", 0, ["no region, as it holds all elements: 'whole'"],
     {"left lobe": 12, "right lobe": 12}),
    ("meshes/groups.inp", "--unit mm --fix set:hilum", 0, ["fixed nodes +24 "], {"left_lobe": 12, "right_lobe": 12}),
    ("meshes/float-labels.vtk", "--unit mm", 0, [], {"region 1": 12, "region 2": 12}),
    ("meshes/ids-binary.vtk", "--unit mm", 0, ["nodes +60,", "tets +144", "left out: cell data 'vtkOriginalCellIds'"],
     {"region 1": 12, "region 2": 12}),
    ("meshes/continued.inp", "--unit mm --fix set:HILUM", 0, ["fixed nodes +12 "], {"LEFT": 12, "RIGHT": 12}),
    ("meshes/two-instances.inp", "--unit mm", 3, [r"a second \*INSTANCE"], {}),
    ("meshes/cylinder.inp", "--unit mm", 3, [r"\*NODE, SYSTEM=C: "], {}),
    ("meshes/bom.inp", "--unit mm", 0, [], {"LEFT": 12, "RIGHT": 12}),
    ("surfaces/upper-case.stl", "--unit mm --nodes 400", 0, [r"the surface's 57\.17 ml"], {}),
    ("surfaces/solid-in-solid.stl", "--unit mm --nodes 800", 0, [r"shells of 1\.873 ml inside another face outwards"],
     {}),
    ("surfaces/weights.glb", "--nodes 400", 3, ["has weights that change its shape"], {}),
    ("scans/sides-disagree.nii.gz", "--nodes 500", 0, ["sform says LAS, qform RAS; sform was taken"], {}),
    ("scans/signed", "--nodes 500", 3, ["is -1, which is no label"], {}),
    ("scans/bits-above", "--nodes 500", 0, [r"the map's 54\.57 ml", r"the map's 5\.211 ml"], {}),
    # 500 nodes are too few for the wall beside the ball, as they are in a map of the same solid.
    ("scans/shared-segment.dcm", "--nodes 1000", 0, [r"the map's 97\.52 ml"], {}),
    ("scans/label-map.dcm", "--nodes 500", 0, [r"Liver: .* the map's 97\.52 ml", r"Tumour: .* the map's 5\.589 ml"], {}),
    ("scans/members.nii.gz", "--nodes 500", 0, [r"the map's 97\.52 ml", r"the map's 5\.589 ml"], {}),
    ("scans/no-scaling.nii.gz", "--nodes 500", 0, [r"the map's 97\.52 ml", r"the map's 5\.589 ml"], {}),
    ("scans/one-slice.nii.gz", "", 3, ["is one slice, 3 mm thick: it has no inside"], {}),
]

# Scene, volumes of the parts at its end in ml (of 64 in all), least force in its probes in N.
SCENES = [
    ("cutting/wedge.toml", [5.24], 0),
    ("cutting/square.toml", [8], 0),
    ("cutting/four-corners.toml", [5.66], 0),
    ("cutting/wedge-again.toml", [5.24], 0),
    ("cutting/waiting-blade.toml", [], 1),
]


def six_volumes(p, q, r, s):
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = ([b - a for a, b in zip(p, o)] for o in (q, r, s))
    return ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)


def volumes_of(mesh):
    """Volumes in ml of the regions of a Gmsh file in mm."""
    lines = iter(mesh.read_text().splitlines())
    names, nodes, volumes = {}, {}, {}
    for line in lines:
        if line == "$PhysicalNames":
            for _ in range(int(next(lines))):
                dimension, number, name = next(lines).split(" ", 2)
                if dimension == "3":
                    names[number] = name.strip('"')
        elif line == "$Nodes":
            for _ in range(int(next(lines))):
                number, *place = next(lines).split()
                nodes[number] = [float(c) for c in place]
        elif line == "$Elements":
            for _ in range(int(next(lines))):
                words = next(lines).split()
                if words[1] != "4":
                    continue
                six = six_volumes(*(nodes[n] for n in words[-4:]))
                name = names.get(words[3], words[3])
                volumes[name] = volumes.get(name, 0) + six / 6 / 1000
    return volumes


def run(program, *arguments):
    done = subprocess.run([program, *arguments], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
    return done.returncode, done.stdout


def fault_of(program, cases, folder, case):
    """Empty, or what comes out otherwise."""
    file, options, code, said, volumes = case
    organ, mesh = folder / "case.organ", folder / "case.msh"
    ended, text = run(program, "import", cases / file, *options.split(), "--out", organ)
    if ended != code:
        return f"exit code {ended}, must be {code}: {text.strip()}"
    for pattern in said:
        if not re.search(pattern, text):
            return f"does not say '{pattern}': {text.strip()}"
    if not volumes:
        return ""
    ended, text = run(program, "export", organ, "--out", mesh, "--unit", "mm")
    if ended != 0:
        return text.strip()
    found = volumes_of(mesh)
    if found.keys() != volumes.keys() or any(abs(found[name] - ml) > 1e-6 * ml for name, ml in volumes.items()):
        return f"regions of {found} ml, must be {volumes}"
    return ""


def array_of(text, name, kind):
    found = re.search(rf'<DataArray[^>]*Name="{name}"[^>]*>(.*?)</DataArray>', text, re.S)
    return [kind(word) for word in found.group(1).split()]


def parts_of(field):
    """Number of nodes, and volumes at rest in ml of what hangs together by faces, the largest last."""
    text = field.read_text()
    numbers = array_of(text, "rest_m", float)
    nodes = [numbers[i:i + 3] for i in range(0, len(numbers), 3)]
    numbers = array_of(text, "connectivity", int)
    tets = [numbers[i:i + 4] for i in range(0, len(numbers), 4)]
    parent = list(range(len(tets)))

    def root(tet):
        while parent[tet] != tet:
            parent[tet] = parent[parent[tet]]
            tet = parent[tet]
        return tet

    other = {}
    for tet, corners in enumerate(tets):
        for left_out in corners:
            face = frozenset(corners) - {left_out}
            parent[root(tet)] = root(other.setdefault(face, tet))
    volumes = {}
    for tet, corners in enumerate(tets):
        ml = abs(six_volumes(*(nodes[n] for n in corners))) / 6 * 1e6
        volumes[root(tet)] = volumes.get(root(tet), 0) + ml
    return len(nodes), sorted(volumes.values())


def fault_of_scene(program, cases, folder, scene):
    """Empty, or what comes out otherwise."""
    file, parts, least_n = scene
    ended, text = run(program, cases / file, "--out", folder / "out")
    if ended != 0:
        return text.strip()
    fields = sorted((folder / "out").glob("field_*.vtu"))
    (before, _), (after, volumes) = parts_of(fields[0]), parts_of(fields[-1])
    wanted = [*parts, 64 - sum(parts)]
    if len(volumes) != len(wanted) or any(abs(v - w) > 0.01 * w for v, w in zip(volumes, wanted)):
        return f"parts of {volumes} ml, must be {wanted}"
    if after <= before:
        return "nothing is cut"
    if least_n > 0:
        rows = [line.split(",") for line in (folder / "out" / "probes.csv").read_text().splitlines()[1:]]
        most_n = max(sum(float(n) ** 2 for n in row[1:4]) ** 0.5 for row in rows)
        if most_n < least_n:
            return f"at most {most_n} N are felt, must be {least_n}"
    return ""


def main():
    binaries = pathlib.Path(sys.argv[1])
    cases = pathlib.Path(os.environ.get("TROCAR_SHARED", sys.argv[2])) / "cases"
    if not cases.is_dir():
        print(f"SKIPPED: there is no folder {cases}", file=sys.stderr)
        return 77
    wrong = 0
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            fault = fault_of(binaries / "trocar-organ", cases, pathlib.Path(folder), case)
        wrong += fault != ""
        print(f"{case[0]}: {fault or 'right'}")
    for scene in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            fault = fault_of_scene(binaries / "trocar-sim", cases, pathlib.Path(folder), scene)
        wrong += fault != ""
        print(f"{scene[0]}: {fault or 'right'}")
    total = len(CASES) + len(SCENES)
    print(f"{total - wrong} of {total} cases come out right")
    return 1 if wrong else 0


sys.exit(main())
